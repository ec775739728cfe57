#!/usr/bin/env python3
"""What perf/driver/instructions.py makes of callgrind's output, and how it judges."""

import pathlib
import sys
import tempfile
import unittest
from unittest import mock

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "perf"))
sys.path.insert(0, str(ROOT / "tests" / "planted"))

from driver import instructions  # noqa: E402
import growth_test  # noqa: E402
import planted  # noqa: E402
import run  # noqa: E402
from driver.instructions import CountingError, NotCountable, Verdict, hub_costs, require_comparable  # noqa: E402

# What runs below counted(): the hub calls memcpy, a library that calls another, and the transport in memory, which is a node's
# and calls the hub's append() and memcpy, too.
PROFILE = """positions: line
events: Ir
summary: 999

ob=/build/program
fl=main.cpp
fn=main
cfn=counted
calls=1 0
5 1000

fn=counted
6 3
cfn=gimnet::hub::Router::route(int)
calls=1 0
7 997

fl=a.cpp
fn=gimnet::hub::Router::route(int)
10 5
+1 7
fi=b.hpp
12 1
cob=/lib/libc.so.6
cfi=???
cfn=memcpy
calls=3 0
12 600
cfn=gimnet::hub::append()
calls=1 0
13 30
cob=/lib/libstdc++.so.6
cfn=operator new(unsigned long)
calls=1 0
14 54
cfn=gimnet::hub::MemoryStream::send(int)
calls=1 0
15 300

fn=gimnet::hub::append()
* 20
cob=/lib/libc.so.6
cfn=memcpy
calls=1 0
* 50

fn=gimnet::hub::MemoryStream::send(int)
3 200
cfn=gimnet::hub::append()
calls=1 0
4 40
cfn=gimnet::hub::MemoryPipe::take(int)
calls=1 0
5 60

fn=gimnet::hub::MemoryPipe::take(int)
3 60

ob=/lib/libstdc++.so.6
fn=operator new(unsigned long)
0 4
cob=/lib/libc.so.6
cfn=malloc
calls=1 0
0 50

ob=/lib/libc.so.6
fn=memcpy
0 650
fn=malloc
0 50
"""


class Profile(unittest.TestCase):
    def test_counts_all_that_the_hub_does_and_nothing_that_plays_the_nodes(self):
        self.assertEqual(hub_costs(PROFILE, "/build/program").total, 1000 - 300)

    def test_what_a_library_takes_is_its_caller_s(self):
        self.assertEqual(hub_costs(PROFILE, "/build/program").by_function,
                         {"counted": 3, "gimnet::hub::Router::route(int)": 13 + 600 + 54, "gimnet::hub::append()": 70})

    def test_nothing_counted_is_nothing(self):
        self.assertEqual(hub_costs("events: Ir\nsummary: 0\n", "/build/program").total, 0)


class Judging(unittest.TestCase):
    def test_two_percent_more_is_allowed_and_nothing_beyond(self):
        self.assertFalse(Verdict("parser", 102.0, 100.0).is_slower)
        self.assertTrue(Verdict("parser", 102.01, 100.0).is_slower)
        self.assertIn("SLOWER", str(Verdict("parser", 105, 100)))

    def test_what_got_faster_is_said_but_no_failure(self):
        verdict = Verdict("parser", 90, 100)
        self.assertTrue(verdict.is_faster and not verdict.is_slower)
        self.assertIn("faster", str(verdict))

    def test_a_script_without_a_budget_fails(self):
        self.assertTrue(Verdict("parser", 90, None).is_slower)

    def test_small_changes_do_not_add_up_beyond_the_base(self):
        self.assertFalse(Verdict("parser", 103.0, 102.0, base=100.0).is_above_base)
        above = Verdict("parser", 103.01, 102.0, base=100.0)
        self.assertTrue(above.is_above_base and not above.is_slower)
        self.assertIn("ABOVE THE BASE", str(above))
        self.assertFalse(Verdict("parser", 110.0, 109.0, base=100.0, base_tolerance=0.1).is_above_base)
        self.assertFalse(Verdict("new", 110.0, 109.0).is_above_base)

    def test_what_a_script_is_allowed_beyond_the_base_has_a_reason(self):
        base = instructions.load_base()
        self.assertGreater(len(base["instructions_per_frame"]), 10)
        for script, allowed in base["allowed"].items():
            self.assertIn(script, base["instructions_per_frame"])
            self.assertTrue(allowed["why"] and allowed["tolerance"] > instructions.BASE_TOLERANCE, script)

    def test_a_script_without_budget_is_told(self):
        self.assertIn("--update", str(Verdict("parser", 90, None)))

    def test_another_compiler_is_not_compared(self):
        made_by = {"compiler": "12.2.0", "processor": "x86_64", "build": "release"}
        require_comparable(made_by, {"made_by": made_by})
        with self.assertRaisesRegex(NotCountable, "13.1.0"):
            require_comparable(made_by | {"compiler": "13.1.0"}, {"made_by": made_by})

    def test_a_budget_that_is_written_is_read_again(self):
        with tempfile.TemporaryDirectory() as folder:
            with mock.patch.object(instructions, "BUDGET", pathlib.Path(folder, "budget.json")):
                self.assertEqual(instructions.load_budget()["instructions_per_frame"], {})
                instructions.update_budget({"compiler": "c"}, [Verdict("parser", 1.5, None)])
                self.assertEqual(instructions.load_budget(),
                                 {"made_by": {"compiler": "c"}, "instructions_per_frame": {"parser": 1.5}})

    def test_a_program_that_is_not_there_is_an_error_with_a_remedy(self):
        with self.assertRaisesRegex(instructions.CountingError, "build it first"):
            instructions.describe(pathlib.Path("/nowhere/instruction_scripts"))


class FailsClosed(unittest.TestCase):
    """What could not be counted has failed, unless no machine like this could."""

    SKIPPED = 77

    def setUp(self):
        made_by = {"compiler": "c", "processor": "x", "build": "release"}
        budget = {"made_by": made_by, "instructions_per_frame": {"parser": 1}}
        growing = list(growth_test.SCRIPTS)
        self.made_by = made_by
        for name, replacement in (("describe", lambda program: (self.made_by, growing if program.name == "growth_scripts" else ["parser"])),
                                  ("count", self.count), ("load_budget", lambda: budget), ("known_scripts", lambda: ["parser", "newer"])):
            patch = mock.patch.object(instructions, name, replacement)
            patch.start()
            self.addCleanup(patch.stop)
        self.error = CountingError("instruction_scripts parser ended with -11")

    def count(self, program, script):
        raise self.error

    def gate(self, *more):
        with mock.patch.object(run, "say"):
            return run.count_instructions(run.parse_arguments(["--instructions", *more]))

    def ends_of_others(self):
        """Exit status or exception of the two other users; None of a planted bug means: not counted."""
        bug = planted.Bug("SLOW", "", "instruction_scripts", [], argument="parser")
        nowhere = pathlib.Path("/nowhere")
        for user in (lambda: growth_test.main(), lambda: planted.found(bug, nowhere)):
            with mock.patch.object(sys, "argv", ["test", "/nowhere"]), mock.patch("builtins.print"):
                try:
                    yield user()
                except CountingError as error:
                    yield error

    def test_a_script_that_crashes_fails(self):
        self.assertEqual(self.gate(), 1)
        self.assertEqual(self.gate("parser"), 1)
        self.assertEqual(list(self.ends_of_others()), [self.error, self.error])

    def test_a_script_that_the_program_does_not_have_fails(self):
        self.assertEqual(self.gate("newer"), 1)

    def test_a_program_that_hangs_fails(self):
        with mock.patch.object(instructions, "SECONDS_MAX", 0.01), self.assertRaises(CountingError) as caught:
            instructions.run_program(["sleep", "60"])
        self.assertNotIsInstance(caught.exception, NotCountable)

    def test_without_valgrind_all_are_left_out(self):
        self.error = NotCountable("valgrind is not installed (package valgrind)")
        self.assertEqual(self.gate(), self.SKIPPED)
        self.assertEqual(list(self.ends_of_others()), [self.SKIPPED, None])

    def test_another_compiler_is_left_out(self):
        self.made_by = self.made_by | {"compiler": "13.1.0"}
        self.assertEqual(self.gate(), self.SKIPPED)


if __name__ == "__main__":
    unittest.main()
