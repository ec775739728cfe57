#!/usr/bin/env python3
"""Which arguments ./dev perf takes, and what it says of those that it does not, before anything is installed or built."""

import contextlib
import io
import os
import unittest
from unittest import mock

import support  # noqa: F401
import run
from driver import against, instructions, subjects, suite, usage


class Arguments(unittest.TestCase):
    def setUp(self):
        # The sources may be here without their history.
        patch = mock.patch.object(against, "commit_of", self.commit_of)
        patch.start()
        self.addCleanup(patch.stop)

    @staticmethod
    def commit_of(root, revision):
        if revision != "HEAD":
            raise against.BuildError(f"there is no version '{revision}': give another")

    def assert_refused(self, words: str, sentence: str):
        said = io.StringIO()
        with contextlib.redirect_stderr(said), self.assertRaises(SystemExit) as caught:
            run.parse_arguments(words.split())
        self.assertEqual(caught.exception.code, 2, words)
        self.assertIn(sentence, said.getvalue())

    def test_numbers_are_above_zero(self):
        for number in ("0", "-1", "1.5", "many", "\u0661"):
            self.assert_refused(f"--runs={number}", "is not a whole number above 0")
            self.assert_refused(f"--size={number}", "is not a whole number above 0")
        self.assertEqual(run.parse_arguments(["--runs", "1"]).runs, 1)

    def test_sizes_and_lengths_are_those_that_the_generator_takes(self):
        for number in ("1", "15", "1048577", "99999999999"):
            self.assert_refused(f"--size={number}", f"'{number}' is not a size that can be measured: give 16 to 1,048,576 bytes")
        self.assertEqual(run.parse_arguments(["--size", "16", "1048576"]).size, [16, 1048576])
        for number in ("0", "-1", "0.009", "450.1", "nan", "inf", "long"):
            self.assert_refused(f"--seconds={number}", f"'{number}' is not a length that can be measured: give 0.01 to 450 seconds")
        for number in (0.01, 450):
            self.assertEqual(run.parse_arguments(["--scenario", "one_to_one", "--seconds", str(number)]).seconds, number)

    def test_the_generator_has_the_same_bounds(self):
        pattern = (support.ROOT / "perf" / "generator" / "messages.hpp").read_text()
        self.assertIn(f"kPayloadBytesMin = {usage.SIZE_MIN};", pattern)
        self.assertIn("kPayloadBytesMax = 1024 * 1024;", pattern)
        self.assertEqual(usage.SIZE_MAX, 1024 * 1024)
        self.assertIn(f"CLI::Range({usage.SECONDS_MIN}, 3600.0)", (support.ROOT / "perf" / "load_generator.cpp").read_text())
        self.assertLessEqual(usage.SECONDS_MAX * max(each.seconds_factor for each in suite.SCENARIOS.values()), 3600)

    def test_a_comparison_that_cannot_be_made_is_refused(self):
        self.assert_refused("--against nonsense", "there is no version 'nonsense'")
        self.assert_refused("--against HEAD --runs 8", "--runs 8: so few pairs cannot show a difference in one of 7 cases; give at least 9")
        self.assert_refused("--against HEAD --runs 5 --scenario in_turns --size 16 --transport tcp", "difference in a case; give at least 6")
        run.parse_arguments("--against HEAD --runs 6 --scenario in_turns --size 16 --transport tcp".split())

    def test_an_unknown_script_is_refused_with_those_that_there_are(self):
        self.assert_refused("--instructions nonsense", "there is no script 'nonsense'; give one of parser_run, ")
        self.assertLessEqual(set(instructions.load_budget()["instructions_per_frame"]), set(instructions.known_scripts()))

    def test_what_would_be_ignored_is_refused(self):
        for words, sentence in (("--update", "--update goes with --instructions"),
                                ("--instructions parser_run --update", "of all scripts"),
                                ("--instructions --runs 3", "--runs means nothing with --instructions"),
                                ("--control --quick", "--quick means nothing with --control"),
                                ("--network --json", "--json means nothing with --network"),
                                ("--python --runs 3", "--runs means nothing with --python"),
                                ("--against HEAD --only nats", "--subjects means nothing with --against"),
                                ("--against HEAD --report", "--report means nothing with --against"),
                                ("--against HEAD --quick", "--quick means nothing with --against"),
                                ("--against HEAD --instructions", "--against means nothing with --instructions"),
                                ("--quick --smoke", "two different runs"), ("--quick --scenario one_to_one --size 16", "leave out --quick, or --scenario, --size"),
                                ("--smoke --transport tcp", "leave out --smoke, or --transport"), ("--smoke --report", "nothing that --report")):
            self.assert_refused(words, sentence)

    def test_a_part_of_the_suite_does_not_replace_the_whole_page(self):
        for words in ("--quick", "--scenario one_to_one", "--size 16", "--transport unix", "--only nats"):
            self.assert_refused(f"{words} --report", "--report replaces the figures of docs/performance.md, and --")
        self.assert_refused("--scenario in_turns --size 16 --report",
                            "keep the result with --json >RESULT.json, and make a page of its own with perf/report.py RESULT.json OTHER.md")

    def test_nothing_to_measure_is_refused(self):
        self.assert_refused("--scenario idle_10000 --transport unix", "these scenarios are not measured over that transport")
        self.assert_refused("--against HEAD --scenario idle_10000 --transport unix", "none of the scenarios asked for exists")

    def test_an_unknown_argument_is_named(self):
        self.assert_refused("--scenaro ping_paced", "--scenaro")
        self.assert_refused("--scenario pingpong", "pingpong")

    def test_the_help_s_example_gives_the_hub_an_option_with_its_value(self):
        said = io.StringIO()
        # Wide enough that no word is parted at its hyphen.
        with mock.patch.dict(os.environ, COLUMNS="400"), contextlib.redirect_stdout(said), self.assertRaises(SystemExit):
            run.parse_arguments(["--help"])
        example = "--hub-argument=--shards --hub-argument=2"
        self.assertIn(example, " ".join(said.getvalue().split()))
        settings = run.make_settings(run.parse_arguments(example.split()))
        self.assertEqual(settings.hub_arguments, ["--shards", "2"])

    def test_the_null_relay_is_always_among_the_subjects_as_the_help_says(self):
        self.assertEqual(run.chosen_subjects(run.parse_arguments(["--only", "nats", "--scenario", "library_burst"])), ("null", "nats"))
        self.assertEqual(run.chosen_subjects(run.parse_arguments([])), subjects.SUBJECTS)

    def test_what_goes_together_is_taken(self):
        for words in ("--instructions --update", "--instructions parser_run", "--control --report --packages", "--quick --json", "--json --report --runs 5",
                      "--against HEAD --runs 9 --json --scenario one_to_one --hub-argument=--spin", "--smoke --only nats",
                      "--build-dir build/release --instructions"):
            run.parse_arguments(words.split())


if __name__ == "__main__":
    unittest.main()
