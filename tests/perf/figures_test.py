#!/usr/bin/env python3
"""What perf/driver makes of several runs: medians of ratios, spreads, verdicts, and which runs are made again."""

import unittest

from support import outcome
from driver import measure, suite
from driver.measure import Settings, run_group
from driver.rows import Outcome, make_rows, shown, text_table
from driver.suite import GOALS, Goal, decisive, verdict

ONE_TO_ONE = suite.Case("one_to_one", 16, "tcp")


class Rows(unittest.TestCase):
    def test_a_ratio_is_the_median_of_the_rounds_ratios(self):
        # The ratio of the medians would be 3: the machine was three times as slow in the third round, for both.
        rows = make_rows([outcome("null", ONE_TO_ONE, [10, 20, 60]), outcome("tcphub", ONE_TO_ONE, [60, 40, 120])])
        self.assertEqual([row["ratio_to_null"] for row in rows], [1.0, 2.0])
        self.assertEqual(rows[1]["spread"]["ratio_to_null"], [2.0, 6.0])
        self.assertEqual((rows[1]["min"], rows[1]["max"], rows[1]["runs"]), (40, 120, 3))

    def test_rounds_that_only_one_of_two_has_are_not_compared(self):
        hub = outcome("tcphub", ONE_TO_ONE, [30, 30])
        hub.add(7, {"cpu_ns_per_message": 99})
        null = outcome("null", ONE_TO_ONE, [10, 15, 20])
        null.add(7, {"cpu_ns_per_message": 33})
        row = make_rows([null, hub])[1]
        self.assertEqual([found.get("ratio_to_null") for found in row["rounds"]], [3, 2, 3])
        self.assertEqual((row["ratio_to_null"], row["cpu_ns_per_message"], row["runs"]), (3, 30, 3))

    def test_unix_is_compared_with_tcp_too(self):
        unix = suite.Case("one_to_one", 16, "unix")
        rows = make_rows([outcome("null", ONE_TO_ONE, [10]), outcome("null", unix, [8]), outcome("tcphub", unix, [4])])
        self.assertEqual((rows[2]["ratio_to_null"], rows[2]["ratio_to_null_tcp"]), (0.5, 0.4))
        self.assertNotIn("ratio_to_null_tcp", rows[0])

    def test_in_turns_is_compared_with_the_null_one_to_one(self):
        rows = make_rows([outcome("null", ONE_TO_ONE, [10]), outcome("tcphub", suite.Case("in_turns", 16, "tcp"), [25])])
        self.assertEqual((rows[1]["ratio_to_null"], rows[1]["baseline"]), (2.5, "one_to_one"))

    def test_losses_of_all_runs_are_summed(self):
        self.assertEqual(make_rows([outcome("tcphub", ONE_TO_ONE, [1, 2], lost=3)])[0]["lost"], 6)

    def test_a_failed_case_has_no_row(self):
        self.assertEqual(make_rows([Outcome("tcphub", ONE_TO_ONE, [], "it died")]), [])

    def test_a_row_without_a_baseline_has_no_ratio(self):
        self.assertIsNone(make_rows([outcome("tcphub", suite.Case("idle_10000", 16, "tcp"), [300])])[0]["ratio_to_null"])

    def test_every_figure_has_its_spread(self):
        case = suite.Case("ping_paced", 16, "tcp")
        hub = Outcome("tcphub", case, [{"p50_us": each, "p999_us": 10 * each} for each in (1, 3, 2)])
        self.assertEqual(make_rows([hub])[0]["spread"], {"p50_us": [1, 3], "p999_us": [10, 30]})

    def test_table_has_a_line_a_row(self):
        self.assertEqual(len(text_table(make_rows([outcome("null", ONE_TO_ONE, [10])])).splitlines()), 2)


class Derived(unittest.TestCase):
    def test_what_load_does_to_a_ping(self):
        idle, loaded = (suite.Case(name, 16, "tcp") for name in ("ping_two_cpus", "ping_under_bulk"))
        rows = make_rows([outcome("tcphub", idle, [50, 50], p99_us=100), outcome("tcphub", loaded, [150, 130])])
        self.assertEqual((rows[1]["p99_over_idle"], rows[1]["spread"]["p99_over_idle"]), (1.4, [1.3, 1.5]))

    def test_the_time_beyond_the_null_relay(self):
        case = suite.Case("connect_10000", 16, "tcp")
        rows = make_rows([outcome("null", case, [0.25, 0.5]), outcome("tcphub", case, [0.75, 0.75])])
        self.assertEqual((rows[1]["seconds_over_null"], rows[1]["spread"]["seconds_over_null"]), (0.375, [0.25, 0.5]))
        self.assertNotIn("seconds_over_null", rows[0])

    def test_how_a_library_does_beside_the_best_other_one_of_each_round(self):
        def runs(subject, transport, rates):
            return Outcome(subject, suite.Case("library_burst", 16, transport),
                           [{"messages_per_second": rate, "cpu_ns_per_message": 2e8 / rate, "system_ns_per_message": 1e8 / rate}
                            for rate in rates])
        rows = make_rows([runs("tcphub", "unix", [6e6, 8e6]), runs("nats", "tcp", [2e6, 1e6]), runs("mosquitto", "tcp", [1e6, 2e6]),
                          runs("mosquitto", "unix", [4e6, 2e6]), runs("tcphub", "tcp", [3e6, 3e6]),
                          runs("cyclonedds", "tcp", [1.5e6, 6e6])])
        self.assertEqual([rows[4]["spread"]["cpu_over_dds"], rows[0]["spread"]["rate_over_tcp"]], [[0.5, 2], [2, 8e6 / 3e6]])
        self.assertEqual(rows[0]["spread"]["rate_over_best"], [3, 4])
        self.assertEqual(rows[0]["spread"]["rate_over_best_unix"], [1.5, 4])
        self.assertAlmostEqual(rows[0]["spread"]["system_over_best_unix"][1], 1 / 1.5)
        self.assertEqual(rows[4]["spread"]["rate_over_best"], [1.5, 1.5])
        self.assertNotIn("rate_over_best_unix", rows[4])
        self.assertEqual(rows[0]["rate_over_best"], 3.5)
        self.assertAlmostEqual(rows[0]["spread"]["system_over_best"][0], 1 / 4)
        self.assertNotIn("rate_over_best", rows[1])


class Figures(unittest.TestCase):
    def test_the_outermost_of_many_runs_decide_nothing(self):
        self.assertEqual(decisive([3, 1, 2]), (1, 3))
        self.assertEqual(decisive([9, 1, 2, 3, 4, 5, 6, 7]), (1, 9))
        self.assertEqual(decisive([9, 1, 2, 3, 4, 5, 6, 7, 8]), (2, 8))

    def test_are_short(self):
        self.assertEqual([shown(value) for value in (None, 0.01234, 12.34, 1234.5)], ["", "0.0123", "12.3", "1,234"])


class Verdicts(unittest.TestCase):
    GOAL = Goal("one_to_one", 16, "tcp", "ratio_to_null", 2.0, 1.25)
    ONLY_GOAL = Goal("library_burst", 16, "tcp", "rate_over_best", None, 15, at_least=True)

    def test_a_limit_itself_is_met(self):
        self.assertTrue(self.GOAL.holds(1.25, self.GOAL.goal))
        self.assertFalse(self.GOAL.holds(1.26, self.GOAL.goal))

    def test_runs_that_agree_decide(self):
        for values, expected in (([1.1, 1.2, 1.25], "goal met"), ([1.3, 1.9, 1.6], "bound met, goal missed"),
                                 ([2.1, 2.2, 2.3], "bound missed")):
            self.assertEqual(verdict(self.GOAL, values), expected)
        self.assertEqual(verdict(self.ONLY_GOAL, [15, 16, 17]), "goal met")
        self.assertEqual(verdict(self.ONLY_GOAL, [11, 12, 14]), "goal missed")

    def test_runs_on_both_sides_of_a_limit_decide_nothing(self):
        self.assertEqual(verdict(self.GOAL, [1.1, 1.2, 1.3]), "bound met, goal undecided")
        self.assertEqual(verdict(self.GOAL, [1.9, 1.9, 2.1]), "bound undecided")
        self.assertEqual(verdict(self.ONLY_GOAL, [14, 16, 16]), "goal undecided")

    def test_no_goal_is_weaker_than_its_bound(self):
        for goal in GOALS:
            if goal.bound is not None:
                self.assertTrue(goal.holds(goal.goal, goal.bound), goal)

    def test_one_wild_run_of_nine_does_not_count(self):
        self.assertEqual(verdict(self.GOAL, [1.1] * 8 + [5]), "goal met")
        self.assertEqual(verdict(self.GOAL, [1.1] * 7 + [1.3, 5]), "bound met, goal undecided")


class Rounds(unittest.TestCase):
    """run_group() with runs that are written down instead of made."""

    def setUp(self):
        self.order = []
        self.addCleanup(setattr, measure, "run_patiently", measure.run_patiently)
        self.addCleanup(setattr, measure, "say", measure.say)
        measure.run_patiently = self.run_patiently
        measure.say = lambda text: None

    def run_patiently(self, outcome, settings):
        self.order.append(outcome.subject)
        return {"cpu_ns_per_message": 1}

    def test_every_second_round_goes_the_other_way(self):
        run_group([Outcome(name, ONE_TO_ONE) for name in ("null", "tcphub", "nats")], Settings(build=None, runs=3))
        self.assertEqual(self.order, ["null", "tcphub", "nats", "nats", "tcphub", "null", "null", "tcphub", "nats"])


if __name__ == "__main__":
    unittest.main()
