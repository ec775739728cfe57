#!/usr/bin/env python3
"""The parts of docs/performance.md that perf/driver writes from the rows of a result."""

import unittest

from support import outcome, result_of
from driver import suite
from driver.document import make_document
from driver.measure import Outcome
from driver.single_writes import HEADING, single_writes_text
from driver.summary import make_rows


class SingleWrites(unittest.TestCase):
    UNBATCHED = suite.Case("one_to_one_unbatched", 16, "tcp")

    def rows(self, *subjects_and_costs):
        return make_rows([outcome(subject, self.UNBATCHED, costs) for subject, costs in subjects_and_costs])

    def text(self, *subjects_and_costs):
        return " ".join(single_writes_text(self.rows(*subjects_and_costs)))

    def test_says_who_is_cheaper_who_dearer_and_of_whom_the_runs_cannot_tell(self):
        text = self.text(("null", [4000, 4000]), ("tcphub", [3000, 2800]), ("nats", [2400, 2100]), ("redis", [6000, 6600]),
                         ("zeromq", [3800, 4800]), ("mosquitto", [2900, 2900]))
        self.assertIn("the null relay takes 4,000 (4,000 to 4,000) ns a message. It reads once, and writes what that read found with one write.", text)
        self.assertIn("In the null relay's cost, cheaper: tcphub 0.725 times (0.7 to 0.75), nats 0.562 times (0.525 to 0.6), mosquitto 0.725 times "
                      "(0.725 to 0.725); dearer: redis 1.57 times (1.5 to 1.65); not told from it by these runs: zeromq 1.07 times (0.95 to 1.2).", text)
        self.assertIn("In tcphub's cost, cheaper: nats 0.775 times (0.75 to 0.8); dearer: redis 2.18 times (2 to 2.36), zeromq 1.49 times (1.27 to 1.71); "
                      "not told from it by these runs: mosquitto 1 times (0.967 to 1.04).", text)
        self.assertIn("The dearest other hub, redis, takes 1.57 times (1.5 to 1.65) the null relay.", text)

    def test_says_that_nobody_is_cheaper(self):
        text = self.text(("null", [4000]), ("tcphub", [4000]), ("redis", [6000]))
        self.assertIn("In the null relay's cost, cheaper: none; dearer: redis 1.5 times; not told from it by these runs: tcphub 1 times.", text)
        self.assertIn("In tcphub's cost, cheaper: none; dearer: redis 1.5 times.", text)

    def test_calls_the_differences_small_where_those_in_bursts_are_larger(self):
        for cost, sentence in ((900, "Differences are small here beside those in bursts: the dearest other hub, redis, takes 1.5 times (1.5 to 1.5) the "
                                     "null relay, and 90 times (90 to 90) in bursts (one_to_one)."),
                               (15, " The dearest other hub, redis, takes 1.5 times (1.5 to 1.5) the null relay, and 1.5 times (1.5 to 1.5) in bursts")):
            burst = suite.Case("one_to_one", 16, "tcp")
            outcomes = [outcome(subject, case, [cost] * 2) for case, costs in ((self.UNBATCHED, (4000, 3000, 6000)), (burst, (10, 10, cost)))
                        for subject, cost in zip(("null", "tcphub", "redis"), costs)]
            self.assertIn(sentence, " ".join(single_writes_text(make_rows(outcomes))))

    def test_says_what_a_unix_socket_gives(self):
        unix = suite.Case("one_to_one_unbatched", 16, "unix")
        rows = make_rows([outcome("null", self.UNBATCHED, [4000]), outcome("tcphub", self.UNBATCHED, [3000]), outcome("tcphub", unix, [1000])])
        self.assertIn("On a Unix socket tcphub takes 0.25 times the null relay on TCP.", " ".join(single_writes_text(rows)))

    def test_compares_round_trips_by_library(self):
        case = suite.Case("library_round_trip", 16, "tcp")
        rows = make_rows([Outcome(subject, case, [{"p50_us": 1, "messages_per_second": rate, "cpu_ns_per_message": 100,
                                                   "system_ns_per_message": system}])
                          for subject, rate, system in (("tcphub", 1000, 80), ("nats", 500, 160), ("mosquitto", 1100, 40))])
        text = " ".join(single_writes_text(rows))
        self.assertIn("1,000 messages/s by NIF and tcphub, and 80% of all their processor time is the kernel's. In that rate, "
                      "slower: nats 0.5 times; faster: mosquitto 1.1 times; in system time a message, "
                      "cheaper: mosquitto 0.5 times; dearer: nats 2 times.", text)

    def test_without_such_rows_there_is_no_such_text(self):
        self.assertEqual(single_writes_text(make_rows([outcome("tcphub", suite.Case("one_to_one", 16, "tcp"), [99])])), [])

    def test_is_a_section_of_the_document(self):
        self.assertIn(HEADING, make_document(result_of(self.rows(("null", [4000]), ("tcphub", [3000])))).splitlines())


if __name__ == "__main__":
    unittest.main()
