#!/usr/bin/env python3
"""What perf/driver/instructions.py makes of callgrind's output, and how it judges."""

import pathlib
import sys
import tempfile
import unittest
from unittest import mock

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "perf"))

from driver import instructions  # noqa: E402
from driver.instructions import Verdict, own_costs, why_incomparable  # noqa: E402

PROFILE = """positions: line
events: Ir
summary: 999

ob=/build/program
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

ob=/lib/libc.so.6
fn=memcpy
0 600

ob=/build/program
fn=gimnet::hub::testing::HubRig::ready(unsigned long)
3 50
fn=gimnet::hub::Outbox::push()
* 20
"""


class Profile(unittest.TestCase):
    def test_counts_the_program_s_own_functions_without_their_callees(self):
        self.assertEqual(own_costs(PROFILE, "/build/program"),
                         {"gimnet::hub::Router::route(int)": 13, "gimnet::hub::Outbox::push()": 20})

    def test_another_program_has_no_part_in_it(self):
        self.assertFalse(own_costs(PROFILE, "/build/other"))


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
        self.assertIn("--update", str(Verdict("parser", 90, None)))

    def test_another_compiler_is_not_compared(self):
        made_by = {"compiler": "12.2.0", "processor": "x86_64", "build": "release"}
        self.assertIsNone(why_incomparable(made_by, {"made_by": made_by}))
        self.assertIn("13.1.0", why_incomparable(made_by | {"compiler": "13.1.0"}, {"made_by": made_by}))

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


if __name__ == "__main__":
    unittest.main()
