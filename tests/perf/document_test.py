#!/usr/bin/env python3
"""The parts of docs/performance.md that perf/driver writes from the rows of a result."""

import contextlib
import io
import json
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

from support import outcome, result_of
import report
import run
from driver import ahead, catalogue, suite
from driver.document import INTRODUCTION, make_document
from driver.measure import Outcome
from driver.single_writes import HEADING, single_writes_text
from driver.summary import make_rows


class Ahead(unittest.TestCase):
    PING = suite.Case("ping_paced", 16, "tcp")

    def listed(self, *outcomes):
        """Figure, other hub and ratio of each line."""
        section = "\n".join(ahead.ahead_lines(make_rows(list(outcomes))))
        return [tuple(line.strip("| ").split(" | ")[each] for each in (3, 4, 7)) for line in section.splitlines() if line.startswith("| ")][2:]

    def test_lists_who_is_better_in_every_round_with_both_values_and_their_ratio(self):
        case = suite.Case("fan_out_10", 1024, "tcp")
        lines = ahead.ahead_lines(make_rows([outcome("null", case, [1, 1]), outcome("tcphub", case, [20, 40]), outcome("redis", case, [10, 30]),
                                             outcome("nats", case, [19, 41]), outcome("tcphub_2_shards", case, [1, 1])]))
        self.assertEqual(lines[-2].splitlines()[2:],
                         ["| fan_out_10 | 1024 | tcp | CPU ns a message | redis | 20 (10 to 30) | 30 (20 to 40) | 0.625 |"])
        self.assertIn(ahead.HEADING, make_document(result_of(make_rows([outcome("tcphub", case, [2]), outcome("nats", case, [1])]))).splitlines())

    def test_rounds_decide_and_not_medians(self):
        ours = outcome("tcphub", self.PING, [100, 200], p99_us=5)
        self.assertEqual(self.listed(ours, outcome("nats", self.PING, [101, 90], p99_us=5)), [])
        self.assertEqual(self.listed(ours, outcome("nats", self.PING, [99, 190], p99_us=5)),
                         [("round trip, us, median", "nats", "0.97")])

    def test_the_best_and_the_worst_of_nine_rounds_do_not_count(self):
        case = suite.Case("in_turns", 16, "tcp")
        ours = outcome("tcphub", case, [10] * 9)
        self.assertEqual(self.listed(ours, outcome("zeromq", case, [5] * 8 + [20])), [("CPU ns a message", "zeromq", "0.5")])
        self.assertEqual(self.listed(ours, outcome("zeromq", case, [5] * 7 + [20, 20])), [])

    def test_round_trips_are_listed_by_both_percentiles_and_libraries_also_by_their_rate(self):
        self.assertEqual(self.listed(outcome("tcphub", self.PING, [100], p99_us=200), outcome("redis", self.PING, [50], p99_us=150)),
                         [("round trip, us, median", "redis", "0.5"), ("round trip, us, 99th percentile", "redis", "0.75")])
        library = suite.Case("library_burst", 16, "tcp")
        more = {"system_ns_per_message": 1}
        self.assertEqual(self.listed(outcome("tcphub", library, [100], messages_per_second=10, **more),
                                     outcome("nats", library, [200], messages_per_second=15, **more),
                                     outcome("mosquitto", library, [200], messages_per_second=5, **more)), [("messages/s", "nats", "1.5")])

    def test_other_transports_are_other_cases(self):
        unix = suite.Case("ping_paced", 16, "unix")
        self.assertEqual(self.listed(outcome("tcphub", self.PING, [100]), outcome("tcphub", unix, [100]), outcome("redis", unix, [200])), [])
        self.assertEqual(len(self.listed(outcome("tcphub", self.PING, [100]), outcome("tcphub", unix, [100]), outcome("redis", unix, [90]))), 1)

    def test_nobody_is_ahead_of_nothing(self):
        case = suite.Case("idle_alone", 16, "tcp")
        self.assertEqual(self.listed(outcome("tcphub", case, [0, 5]), outcome("nats", case, [0, 2])), [])
        self.assertEqual(self.listed(outcome("tcphub", case, [4, 5]), outcome("nats", case, [0, 2])), [("context switches/s", "nats", "0.2")])

    def test_says_that_there_is_none_and_nothing_where_no_other_hub_was_measured(self):
        ours = outcome("tcphub", self.PING, [100])
        self.assertIn("There is none.", ahead.ahead_lines(make_rows([ours, outcome("redis", self.PING, [200])])))
        self.assertEqual(ahead.ahead_lines(make_rows([outcome("null", self.PING, [1]), ours])), [])

    def test_every_figure_that_decides_has_a_title(self):
        for scenario in suite.SCENARIOS:
            for name in ahead.figures_of(scenario):
                self.assertIn(name, ahead.TITLES)


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


class Lengths(unittest.TestCase):
    def test_what_was_measured_longer_is_said_and_what_was_not_measured_is_not(self):
        paced = suite.Case("ping_paced", 16, "tcp")
        rows = make_rows([outcome("null", paced, [1]), outcome("tcphub", paced, [1]), outcome("nats", suite.Case("one_to_one", 16, "tcp"), [1])])
        longer = {"longer": [["ping_paced", 16, "tcp", 20, ["null", "tcphub", "tcphub_spinning"]], ["library_burst", 16, "tcp", 5, ["tcphub", "nats"]]]}
        self.assertIn(" of 1 s each (ping_paced 4, ping_paced 16 B tcp of null, tcphub 20 s);", make_document(result_of(rows) | longer))
        self.assertIn(" of 1 s each;", make_document(result_of(rows[2:]) | longer))


class WhatIsLeftOut(unittest.TestCase):
    """What the introduction says of the whole run is so."""

    PLAN = suite.whole_plan(catalogue.SUBJECTS)

    def sizes(self, scenario):
        return {case.size for case in self.PLAN if case.scenario == scenario}

    def test_sizes(self):
        self.assertIn("leaves out one_to_one_unbatched at 64 KiB and 1 MiB", INTRODUCTION)
        self.assertEqual(set(suite.SIZES) - self.sizes("one_to_one_unbatched"), {65536, 1048576})
        self.assertIn("fan_out_1000,\nlist_100 and broadcast_100 but for 16 and 1,024 bytes", INTRODUCTION)
        for scenario in ("fan_out_1000", "list_100", "broadcast_100"):
            self.assertEqual(self.sizes(scenario), {16, 1024})
        self.assertGreaterEqual(self.sizes("fan_out_10") & self.sizes("fan_out_100"), {16, 256, 1024, 4096, 65536})

    def test_subjects(self):
        def cases(*names):
            return {case for case, subjects in self.PLAN.items() if set(names) & set(subjects)}

        self.assertIn("two shards over Unix sockets; spinning but at 16\nbytes", INTRODUCTION)
        self.assertEqual({case.transport for case in cases("tcphub_2_shards")}, {"tcp"})
        self.assertEqual({case.size for case in cases("tcphub_spinning")}, {16})
        self.assertIn("of other hubs over Unix sockets all but what goes between two", INTRODUCTION)
        over_unix = {case.scenario for case in cases("mosquitto", "redis", "zeromq") if case.transport == "unix"}
        self.assertEqual(over_unix, suite.OF_TWO | {name for name, spec in suite.SCENARIOS.items() if spec.roles is not None})

    def test_other_sizes_are_measured_of_all_subjects(self):
        self.assertIn("`--scenario NAME --size BYTES` measures other sizes, of\nall subjects", INTRODUCTION)
        plan = run.choose_plan(run.parse_arguments("--scenario one_to_one_unbatched --size 65536".split()))
        self.assertEqual(plan[suite.Case("one_to_one_unbatched", 65536, "tcp")], catalogue.SUBJECTS)

    def test_only_our_hub_has_lanes(self):
        line = next(line for line in INTRODUCTION.splitlines() if line.startswith("| ping_under_bulk"))
        self.assertIn("lanes are tcphub's alone: other hubs have none, and ping and bulk share what they have", line)


class Report(unittest.TestCase):
    """perf/report.py as it is called."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def report(self, text: str | bytes | None):
        """The exit status and what was said, of a file with this in it."""
        path = self.folder / "result.json"
        if text is not None:
            path.write_bytes(text if isinstance(text, bytes) else text.encode())
        said = io.StringIO()
        with contextlib.redirect_stderr(said), mock.patch.object(sys, "argv", ["report.py", str(path), str(self.folder / "page.md")]), \
                mock.patch.object(report, "write_report", lambda result, target: target.write_text(make_document(result))):
            return report.main(), said.getvalue().replace(str(self.folder), "")

    def test_what_is_no_result_is_named_in_one_sentence(self):
        good = result_of([])
        for text, sentence in ((None, "/result.json cannot be read: No such file or directory"), ("{", "/result.json is not JSON ("),
                               (b"\xff\xfe", "/result.json is not JSON ("), ("", "/result.json is not JSON ("),
                               ("[]", "/result.json is not a result of ./dev perf --json: it has no results, machine,"),
                               ('{"rejoin": []}', "it has no results, machine,"),
                               (json.dumps({name: value for name, value in good.items() if name != "date"}), "it has no date"),
                               (json.dumps(good | {"results": [{"subject": "null"}]}), "/result.json does not hold the runs of each row"),
                               (json.dumps(good | {"machine": {}}), "/result.json is not a whole result of ./dev perf --json: KeyError"),
                               (json.dumps(good | {"results": [1]}), "does not hold the runs"), (json.dumps(good | {"results": 1}), "does not hold")):
            status, said = self.report(text)
            self.assertEqual((status, said.count("\n")), (1, 1), said)
            self.assertIn(sentence, said)
            self.assertFalse((self.folder / "page.md").exists())

    def test_a_result_becomes_the_page_that_is_named(self):
        self.assertEqual(self.report(json.dumps(result_of([]))), (0, ""))
        self.assertTrue((self.folder / "page.md").read_text().startswith("# Performance"))


if __name__ == "__main__":
    unittest.main()
