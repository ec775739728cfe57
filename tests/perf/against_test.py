#!/usr/bin/env python3
"""./dev perf --against without its builds: when two versions are told apart, alone and among many cases."""

import math
import pathlib
import random
import unittest
from unittest import mock

from support import ROOT
import run
from driver import against, measure, suite
from driver.against import CONFIDENCE, RATIO_MAX, compare, compare_all, interval, pairs_min, signed_rank_p
from driver.subjects import SubjectError

OLD = [100.0, 104.0, 98.0, 101.0, 99.0, 130.0, 100.5, 102.0, 97.0, 100.0, 103.0, 99.5]
NOISE = [1.01, 0.985, 1.002, 0.999, 1.02, 0.98, 0.995, 1.004, 1.015, 0.99, 0.997, 1.006]


def pairs(factor: float) -> list[tuple[float, float]]:
    return [(old, old * noise * factor) for old, noise in zip(OLD, NOISE)]


class Pairs(unittest.TestCase):
    def test_signed_ranks_are_exact(self):
        # All of six on one side: 2 of 64 choices of signs. One of six on the other, and the smallest: 4 of 64.
        self.assertAlmostEqual(signed_rank_p([1, 2, 3, 4, 5, 6]), 2 / 64)
        self.assertAlmostEqual(signed_rank_p([-1, 2, 3, 4, 5, 6]), 4 / 64)
        self.assertEqual(signed_rank_p([0, 0]), 1)
        self.assertEqual(signed_rank_p([1, -1, 1, -1]), 1)

    def test_what_is_zero_or_as_large_either_way_speaks_against_a_difference(self):
        self.assertAlmostEqual(signed_rank_p([0, 2, 3, 4, 5, 6]), 4 / 64)
        self.assertGreater(signed_rank_p([-2, 2, 3, 4, 5, 6]), signed_rank_p([-1, 2, 3, 4, 5, 6]))

    def test_the_interval_is_that_of_the_tables_for_the_signed_rank_test(self):
        # Of ten pairs 8 is the largest sum of ranks that is ruled out at 5 %, two-sided: the ninth Walsh average of 55 from either end.
        self.assertEqual(interval([1, 2, 3, 4, 5, 6, 7, 8, 9, 10], 1), (3, 8))
        self.assertEqual(interval([1, 2, 3, 4, 5], 1), (-math.inf, math.inf))
        self.assertEqual(interval([1, 2, 3, 4, 5, 6], 1), (1, 6))

    def test_the_estimate_is_the_median_of_the_means_of_each_two(self):
        self.assertAlmostEqual(math.log(compare([0.1, 0.2, 0.6], 1).ratio), 0.275)

    def test_interval_verdict_and_confidence_never_contradict_each_other(self):
        chance = random.Random(3)
        verdicts = set()
        for number in range(600):
            differences = [chance.gauss(0.7, 1) for _ in range(chance.choice((6, 9, 12)))]
            if number % 2:
                differences = [round(each) / 10 for each in differences]  # with many that are equal, or 0
            for cases in (1, 7):
                found = compare(differences, cases)
                verdicts.add(found.verdict)
                self.assertEqual(found.verdict != "no difference shown", 1 - found.p_of_all >= CONFIDENCE)
                self.assertEqual(found.verdict == "slower", found.low > 1)
                self.assertEqual(found.verdict == "faster", found.high < 1)
                self.assertLessEqual(found.low, found.ratio)
                self.assertLessEqual(found.ratio, found.high)
        self.assertEqual(len(verdicts), 2)

    def test_the_interval_holds_what_is_true_about_as_often_as_it_says(self):
        chance = random.Random(5)
        held = sum(low <= 0.3 <= high for low, high in (interval([chance.gauss(0.3, 1) for _ in range(12)], 1) for _ in range(1000)))
        self.assertGreaterEqual(held, 935)
        self.assertLessEqual(held, 980)

    def test_the_same_version_is_not_different(self):
        for case in (pairs(1), [(old, old) for old in OLD]):
            self.assertEqual(compare_all([case])[0].verdict, "no difference shown")

    def test_a_change_beyond_the_noise_is_seen_with_its_size_also_among_many_cases(self):
        for factor, verdict in ((1.05, "slower"), (0.95, "faster")):
            found = compare_all([pairs(1), pairs(factor), *[pairs(1)] * 5])
            self.assertEqual([each.verdict for each in found], ["no difference shown", verdict, *["no difference shown"] * 5])
            self.assertGreater(1 - found[1].p_of_all, 0.99)
            self.assertLess(found[1].low, factor)
            self.assertGreater(found[1].high, factor)

    def test_nothing_against_nothing_is_no_difference_and_something_is_one(self):
        nothing, more, less = compare_all([[(0, 0)] * 12, [(0, 3)] * 12, [(3, 0)] * 12])
        self.assertEqual((nothing.verdict, nothing.ratio), ("no difference shown", 1))
        self.assertEqual((more.verdict, less.verdict), ("slower", "faster"))
        self.assertAlmostEqual(more.ratio, RATIO_MAX, delta=1)

    def test_one_wild_pair_decides_nothing(self):
        wild = [(OLD[0], OLD[0] * 9), *((old, old) for old in OLD[1:])]
        self.assertEqual(compare_all([wild])[0].verdict, "no difference shown")


class ManyCases(unittest.TestCase):
    def test_each_case_is_asked_the_more_the_more_there_are(self):
        alone, among = compare_all([pairs(1.05)])[0], compare_all([pairs(1.05)] * 7)[0]
        self.assertAlmostEqual(among.p_of_all, 7 * alone.p)
        self.assertLess(among.low, alone.low)
        self.assertGreater(among.high, alone.high)
        self.assertEqual(compare_all([pairs(1)] * 7)[0].p_of_all, 1)

    def test_what_would_be_a_difference_alone_is_none_among_many(self):
        # Seven pairs all on one side: p is 2 of 128, times seven it is above one in twenty.
        doubtful = [(100.0, 101.0 + step) for step in range(7)]
        alone, among = compare_all([doubtful])[0], compare_all([doubtful, *[pairs(1)] * 6])[0]
        self.assertEqual((alone.verdict, among.verdict), ("slower", "no difference shown"))
        self.assertAlmostEqual(among.p_of_all, 7 * alone.p)

    def test_noise_in_seven_cases_is_seldom_called_a_difference(self):
        chance = random.Random(7)
        comparisons = 200
        false_alarms = 0
        for _ in range(comparisons):
            found = [compare([chance.gauss(0, 1) for _ in range(12)], 7) for _ in range(7)]
            false_alarms += any(each.verdict != "no difference shown" for each in found)
        self.assertLessEqual(false_alarms, 2 * (1 - CONFIDENCE) * comparisons)

    def test_more_cases_need_more_pairs(self):
        self.assertEqual([pairs_min(cases) for cases in (1, 2, 7)], [6, 7, 9])
        self.assertLessEqual(pairs_min(len(against.CASES)), against.PAIRS)
        with self.assertRaisesRegex(against.BuildError, "--runs 8: .* one of 7 cases; give at least 9"):
            against.compare_versions(ROOT, "HEAD", list(against.CASES), 8, None)

    def test_nothing_to_compare_is_said(self):
        with self.assertRaisesRegex(against.BuildError, "none of the scenarios"):
            against.compare_versions(ROOT, "HEAD", [], None, None)

    def test_an_unknown_version_is_named(self):
        with self.assertRaisesRegex(against.BuildError, "no version 'nonsense~'"):
            against.compare_versions(ROOT, "nonsense~", list(against.CASES), None, None)


class Report(unittest.TestCase):
    """compare_versions() with figures that are given instead of measured."""

    def setUp(self):
        for name in ("build_version", "commit_of", "measure_once", "say"):
            self.addCleanup(setattr, against, name, getattr(against, name))
        self.said = []
        self.order = []
        self.more = {}
        self.factor = 1.1
        self.failing = None
        against.build_version = lambda root, revision: ("c0ffee", pathlib.Path("old"))
        against.commit_of = lambda root, revision: "c0ffee"
        against.measure_once = self.measure_once
        against.say = self.said.append

    def measure_once(self, build, case, settings):
        self.order.append(str(build))
        if case == self.failing:
            raise SubjectError("tcphub: it died")
        cost = (100.0 + len(self.order) % 7) * (1 if build == pathlib.Path("old") else self.factor)
        return {case.spec.metric: cost} | (self.more if build != pathlib.Path("old") else {})

    def compare(self):
        """The document, and the exit status of ./dev perf."""
        documents = []
        arguments = run.parse_arguments(["--against", "HEAD~1", "--scenario", "one_to_one", "--size", "16", "256", "--transport", "tcp",
                                         "--runs", "8"])
        real = against.compare_versions

        def keep(*given):
            documents.append(real(*given))
            return documents[-1]

        with mock.patch.object(against, "compare_versions", keep), mock.patch.object(run, "say", self.said.append):
            status = run.compare_versions(arguments)
        return documents[0], status

    def test_says_the_verdict_of_each_case_and_what_the_confidence_is_of(self):
        settings = against.Settings(build=pathlib.Path("new"))
        document = against.compare_versions(ROOT, "HEAD~1", [suite.Case("one_to_one", size, "tcp") for size in (16, 256)], 8, settings)
        self.assertEqual(self.order[:6], ["old", "new", "new", "old", "old", "new"])
        self.assertEqual([each["verdict"] for each in document["comparisons"]], ["slower", "slower"])
        self.assertIn("+9.5 %  (between +6.3 and +11.1 %)  slower", self.said[-1])
        self.assertIn("slower, confidence 98.4 %, 8 pairs", self.said[-1])
        self.assertIn("The confidence is 1 - p of the test of all 2 cases together", self.said[-1])
        self.assertIn("the true changes of all 2 cases lie between", self.said[-1])

    def test_a_difference_that_is_not_shown_has_no_confidence_but_bounds(self):
        self.factor = 1.0
        self.compare()
        self.assertRegex(self.said[-1], r"\(between -\d+\.\d and \+\d+\.\d %\)  no difference shown, 8 pairs")
        self.assertNotIn("onfidence", self.said[-1])

    def test_slower_is_a_failure_and_nothing_else_is(self):
        for factor, verdict, expected in ((1.1, "slower", 1), (1.0, "no difference shown", 0), (0.9, "faster", 0)):
            self.factor = factor
            document, status = self.compare()
            self.assertEqual({each["verdict"] for each in document["comparisons"]}, {verdict})
            self.assertEqual(status, expected)

    def test_what_arrived_wrong_is_a_failure_and_what_was_lost_is_said(self):
        self.factor = 1.0
        for name, status, sentence in (("wrong", 1, "error: this version, one_to_one 16 B tcp: 8 messages arrived that were not sent so"),
                                       ("ledger_gap", 1, "the hub's ledger does not explain 8 frames"),
                                       ("lost", 0, "warning: this version, one_to_one 16 B tcp: 8 messages were lost")):
            self.more = {name: 1}
            document, found = self.compare()
            self.assertEqual(found, status)
            self.assertIn(sentence, "\n".join(document["faults"]))
            self.assertIn(sentence, "\n".join(self.said))

    def test_gaps_either_way_do_not_make_up_for_each_other(self):
        self.more = {"ledger_gap": -1}
        self.assertIn("does not explain 8 frames", "\n".join(self.compare()[0]["faults"]))

    def test_a_case_that_fails_ends_no_other(self):
        self.factor = 1.0
        self.failing = suite.Case("one_to_one", 16, "tcp")
        document, status = self.compare()
        self.assertEqual([each["size"] for each in document["comparisons"]], [256])
        self.assertEqual(document["faults"], ["error: one_to_one 16 B tcp: tcphub: it died"])
        self.assertEqual(status, 1)
        self.assertFalse(against.compare_versions(ROOT, "HEAD", [self.failing], None, against.Settings(build=pathlib.Path("n")))["is_good"])

    def test_a_run_that_fails_once_is_made_again(self):
        tries = []

        def run_once(*_):
            tries.append(1)
            if len(tries) == 1:
                raise SubjectError("the machine stood still")
            return {"cpu_ns_per_message": 1.0}

        with mock.patch.object(measure, "run_once", run_once), mock.patch.object(measure, "say", self.said.append):
            measure.run_with_tries(lambda: None, suite.Case("one_to_one", 16, "tcp"), against.Settings(build=pathlib.Path("n")))
        self.assertEqual(len(tries), 2)
        self.assertIn("once more", self.said[-1])


if __name__ == "__main__":
    unittest.main()
