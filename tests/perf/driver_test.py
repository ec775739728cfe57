#!/usr/bin/env python3
"""perf/run.py without the programs that it runs: what is compared with what, and how rows and the document are made."""

import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

from support import ROOT, outcome
import run
from driver import measure, subjects, suite
from driver.measure import make_group
from driver.rows import Outcome, absence_lines, make_absences
from driver.suite import GOALS


# All subjects but the other hubs, which are measured by their libraries only.
OURS = tuple(name for name in subjects.SUBJECTS if name not in suite.RIVALS)


class Suite(unittest.TestCase):
    def test_every_list_of_cases_is_legal(self):
        for cases in (suite.whole_cases(), suite.quick_cases(), suite.smoke_cases()):
            self.assertEqual(len(cases), len(set(cases)))
            for case in cases:
                self.assertIn(case.scenario, suite.SCENARIOS)
                self.assertTrue(case.spec.sizes_over(case.transport), f"{case} has no such transport")

    def test_smoke_leaves_no_scenario_out(self):
        self.assertEqual({case.scenario for case in suite.smoke_cases()}, set(suite.SCENARIOS))

    def test_in_turns_is_compared_with_one_to_one(self):
        self.assertEqual(suite.Case("in_turns", 16, "tcp").baseline, suite.Case("one_to_one", 16, "tcp"))

    def test_quick_measures_every_goal_of_the_hub(self):
        quick, whole = set(suite.quick_cases()), set(suite.whole_cases())
        plan = suite.quick_plan(subjects.SUBJECTS)
        for goal in GOALS:
            case = suite.Case(goal.scenario, goal.size, goal.transport)
            self.assertIn(case, whole if case.spec.roles is not None else quick)
            if case in quick:
                self.assertIn(goal.subject, plan[case])

    def test_the_whole_suite_has_every_size_and_the_hub_s_variants_where_they_are_for(self):
        plan = suite.whole_plan(subjects.SUBJECTS)
        for name in ("one_to_one", "in_turns", "fan_out_10"):
            self.assertEqual({case.size for case in plan if case.scenario == name and case.transport == "tcp"}, set(suite.SIZES))
        for name in ("one_to_one_unbatched", "four_to_four", "fan_out_100"):
            self.assertGreaterEqual({case.size for case in plan if case.scenario == name}, {16, 1024, 4096})
        self.assertEqual(plan[suite.Case("one_to_one", 16, "tcp")], OURS)
        self.assertNotIn("tcphub_2_shards", plan[suite.Case("one_to_one", 16, "unix")])
        self.assertNotIn("tcphub_spinning", plan[suite.Case("fan_out_10", 16, "tcp")])
        self.assertIn("tcphub_2_shards", plan[suite.Case("stalled_subscriber", 1024, "tcp")])
        self.assertEqual(plan[suite.Case("fan_out_10", 16, "unix")], ("null", "tcphub"))
        runs = sum(len(subjects) for subjects in plan.values())
        self.assertLess(runs, 420, "three of each, of a second, shall take no more than twenty minutes")
        self.assertIn("tcphub_spinning", plan[suite.Case("ping_paced", 16, "tcp")])

    def test_what_is_asked_for_is_measured_on_every_subject(self):
        plan = suite.chosen_plan(["fan_out_10", "idle_10000"], [256], [], subjects.SUBJECTS)
        self.assertEqual(plan, {suite.Case(name, 256, transport): OURS for name, transport in
                                (("fan_out_10", "tcp"), ("fan_out_10", "unix"), ("idle_10000", "tcp"))})

    def test_libraries_are_measured_where_a_hub_has_one(self):
        plan = suite.whole_plan(subjects.SUBJECTS)
        self.assertEqual(plan[suite.Case("library_burst", 16, "tcp")], ("tcphub", "nats", "mosquitto", "cyclonedds"))
        self.assertEqual(suite.smoke_plan(("null", "tcphub"))[suite.Case("library_burst", 16, "tcp")], ("tcphub",))

    def test_quick_measures_the_hub_s_variants_where_they_are_for(self):
        plan = suite.quick_plan(subjects.SUBJECTS)
        self.assertEqual(plan[suite.Case("one_to_one", 16, "tcp")], OURS)
        self.assertEqual(plan[suite.Case("fan_out_10", 16, "tcp")], ("null", "tcphub", "tcphub_2_shards"))
        self.assertEqual(plan[suite.Case("ping_two_cpus", 16, "unix")], ("null", "tcphub", "tcphub_spinning"))

    def test_smoke_runs_the_hub_in_every_case_and_each_subject_in_some(self):
        plan = suite.smoke_plan(subjects.SUBJECTS)
        self.assertTrue(all("tcphub" in subjects for subjects in plan.values()))
        self.assertEqual({name for subjects in plan.values() for name in subjects}, set(subjects.SUBJECTS))


    def test_smoke_gives_the_hub_a_second_of_every_scenario(self):
        settings = run.make_settings(run.parse_arguments(["--smoke"]))
        lengths = {(case, name): settings.length_of(name, case) for case, subjects in suite.smoke_plan(subjects.SUBJECTS).items()
                   for name in subjects}
        self.assertEqual({case.scenario for (case, _), seconds in lengths.items() if seconds == 1}, set(suite.SCENARIOS))
        self.assertLess(sum(lengths.values()), 35)
        self.assertLess(settings.clients, 1000)

    def test_a_whole_run_measures_rare_and_coarse_figures_long_enough(self):
        whole = run.make_settings(run.parse_arguments([]))
        case = suite.Case("ping_paced", 16, "tcp")
        self.assertEqual([whole.length_of(name, case) for name in ("tcphub_spinning", "tcphub_2_shards")], [20, 2])
        self.assertEqual(whole.length_of("mosquitto", suite.Case("library_burst", 16, "unix")), 5)
        self.assertEqual(whole.length_of("tcphub", suite.Case("one_to_one", 16, "tcp")), 0.5)
        round_trips = 1_000 * whole.length_of("tcphub_spinning", case)
        self.assertGreaterEqual(round_trips * (1 - 0.999), 20, "as many lie beyond the 99.9th percentile")
        for words in (["--quick"], ["--smoke"], ["--seconds", "0.5"]):
            self.assertLess(run.make_settings(run.parse_arguments(words)).length_of("tcphub_spinning", case), 3)
        longer = sum((seconds - 0.5 * case.spec.seconds_factor) * len(names) for case, (seconds, names) in suite.WHOLE_SECONDS.items())
        self.assertLess(3 * longer, 300, "a whole run shall stay one of less than an hour")

    def test_some_scenarios_are_measured_longer(self):
        settings = run.make_settings(run.parse_arguments(["--seconds", "2"]))
        self.assertEqual([settings.length_of("tcphub", suite.Case(name, 16, "tcp")) for name in ("one_to_one", "ping_paced")], [2, 8])
        self.assertEqual(run.make_settings(run.parse_arguments(["--smoke", "--seconds", "2"])).length_of(
            "nats", suite.Case("one_to_one", 16, "tcp")), 2)


class Subjects(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.build = pathlib.Path(folder.name)
        (self.build / "bin").mkdir()

    def test_a_library_that_is_not_installed_says_so(self):
        case = suite.Case("library_burst", 16, "tcp")
        self.assertIn("libnats-dev", subjects.why_absent("nats", case, self.build))
        (self.build / "bin" / subjects.CLIENTS["nats"]).touch()
        with mock.patch.object(subjects, "find_program", lambda name: None):
            self.assertIn("nats-server", subjects.why_absent("nats", case, self.build))
        with mock.patch.object(subjects, "find_program", lambda name: name):
            self.assertIsNone(subjects.why_absent("nats", case, self.build))

    def test_what_a_subject_does_not_have_is_said(self):
        self.assertIn("Unix", subjects.why_absent("nats", suite.Case("library_burst", 16, "unix"), self.build))
        self.assertIn("librar", subjects.why_absent("mosquitto", suite.Case("one_to_one", 16, "tcp"), self.build))
        self.assertIn("bursts", subjects.why_absent("cyclonedds", suite.Case("library_request", 16, "tcp"), self.build))
        self.assertIsNotNone(subjects.why_absent("null", suite.Case("idle_10000", 16, "tcp"), self.build))
        self.assertIsNone(subjects.why_absent("tcphub", suite.Case("list_100", 16, "unix"), self.build))

    def test_subjects_take_turns_with_their_baseline(self):
        case = suite.Case("list_100", 16, "tcp")
        group = make_group([(case, ("null", "tcphub"))], self.build)
        self.assertEqual([(each.subject, each.case.scenario, each.is_absent) for each in group],
                         [("null", "fan_out_100", False), ("tcphub", "list_100", False)])

    def test_each_baseline_stands_before_what_is_compared_with_it(self):
        tcp, unix = suite.Case("one_to_one", 16, "tcp"), suite.Case("one_to_one", 16, "unix")
        in_turns = suite.Case("in_turns", 16, "unix")
        self.assertEqual({tcp.group, unix.group, in_turns.group}, {tcp})
        group = make_group([(case, ("null", "tcphub")) for case in (tcp, unix, in_turns)], self.build)
        self.assertEqual([(each.subject, each.case) for each in group],
                         [("null", tcp), ("tcphub", tcp), ("null", unix), ("tcphub", unix), ("tcphub", in_turns)])

    def test_a_library_s_transports_take_turns_with_the_other_libraries(self):
        tcp, unix = suite.Case("library_burst", 16, "tcp"), suite.Case("library_burst", 16, "unix")
        self.assertEqual(unix.group, tcp)
        for name in ("tcphub", "nats"):
            (self.build / "bin" / subjects.CLIENTS[name]).touch()
        group = make_group([(case, ("tcphub", "nats", "mosquitto")) for case in (tcp, unix)], self.build)
        self.assertEqual([(each.subject, each.case.transport) for each in group],
                         [(name, transport) for transport in ("tcp", "unix") for name in ("tcphub", "nats", "mosquitto")])
        self.assertIn("libmosquitto-dev", group[2].error)

    def test_another_hub_s_failure_is_not_ours(self):
        case = suite.Case("one_to_one", 16, "tcp")
        self.assertEqual(run.judge([Outcome("nats", case, [], "it died")], [], is_smoke=False), 0)
        self.assertEqual(run.judge([Outcome("tcphub", case, [], "it died")], [], is_smoke=False), 1)
        self.assertEqual(run.judge([Outcome("nats", case, [], "absent", is_absent=True)], [], is_smoke=True), 0)

    def test_a_message_that_was_not_sent_so_fails_the_run(self):
        row = {"subject": "tcphub", "scenario": "one_to_one", "size": 16, "transport": "tcp"}
        self.assertEqual(run.judge([], [row | {"wrong": 1}], is_smoke=False), 1)
        self.assertEqual(run.judge([], [row | {"ledger_gap": 1}], is_smoke=False), 1)
        self.assertEqual(run.judge([], [row | {"lost": 1}], is_smoke=False), 0)
        self.assertEqual(run.judge([], [row | {"lost": 1}], is_smoke=True), 1)

    def test_packages_are_those_of_the_subjects(self):
        arguments = run.parse_arguments(["--only", "nats", "tcphub", "--scenario", "library_burst"])
        self.assertEqual(run.chosen_subjects(arguments), ("null", "tcphub", "nats"))
        self.assertEqual(run.needed_packages(arguments), ["nats-server", "libnats-dev"])
        self.assertEqual(run.needed_packages(run.parse_arguments(["--quick"])), [])
        self.assertEqual(run.needed_packages(run.parse_arguments(["--subjects", "tcphub"])), [])


class Parameters(unittest.TestCase):
    def test_the_null_relay_has_the_hub_s_send_buffer(self):
        limits = (ROOT / "src" / "hub" / "limits.hpp").read_text()
        (bytes_of_hub,) = re.findall(r"socket_send_bytes = ([0-9* ]+);", limits)
        factors = [int(factor) for factor in bytes_of_hub.split("*")]
        self.assertEqual(subjects.SEND_BUFFER_BYTES, math.prod(factors))


class Ledgers(unittest.TestCase):
    """Of library runs, which other programs make than the generator."""

    def test_a_hub_of_ours_tells_it_and_others_have_none(self):
        case = suite.Case("library_burst", 16, "tcp")
        settings = run.make_settings(run.parse_arguments([]))
        answer = subprocess.CompletedProcess([], 0, '{"cpu_share": 0, "ledger_gap": 3, "dropped_frames": 1, "queued_frames": 0}', "")
        with mock.patch.object(measure.subprocess, "run", return_value=answer) as ran:
            self.assertEqual(measure.ask_for_ledger(self.subject("nats"), case, settings), {})
            ran.assert_not_called()
            self.assertEqual(measure.ask_for_ledger(self.subject("tcphub"), case, settings),
                             {"ledger_gap": 3, "dropped_frames": 1, "queued_frames": 0})
        failed = subprocess.CompletedProcess([], 1, "", "no answer")
        with mock.patch.object(measure.subprocess, "run", return_value=failed), self.assertRaisesRegex(subjects.SubjectError, "no answer"):
            measure.ask_for_ledger(self.subject("tcphub"), case, settings)

    @staticmethod
    def subject(name: str):
        subject = mock.Mock(urls={"tcp": "tcp://127.0.0.1:1"}, pid=1)
        subject.name = name
        return subject


class Absences(unittest.TestCase):
    def test_one_line_a_subject_and_reason(self):
        outcomes = [Outcome("nats", suite.Case("one_to_one", size, "unix"), [], "it has no Unix socket", True)
                    for size in (16, 256)]
        absences = make_absences(outcomes + [outcome("tcphub", suite.Case("one_to_one", 16, "tcp"), [1])])
        self.assertEqual([each["size"] for each in absences], [16, 256])
        self.assertEqual(absence_lines(absences),
                         ["nats: one_to_one 16 B unix, one_to_one 256 B unix: it has no Unix socket"])


if __name__ == "__main__":
    unittest.main()
