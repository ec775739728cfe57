#!/usr/bin/env python3
"""The programs that are shipped have what makes a mistake with memory end them instead of serving whoever found it:
hardening_test.py CONFIGURATION PROGRAM..."""

import re
import subprocess
import sys
import unittest


def readelf(program, *options):
    return subprocess.run(["readelf", "--wide", *options, program], check=True, capture_output=True, text=True,
                          timeout=30).stdout


class Hardening(unittest.TestCase):
    configuration = ""
    programs = ()

    def each(self, look):
        self.assertTrue(self.programs)
        for program in self.programs:
            with self.subTest(program):
                look(program)

    def test_is_loaded_at_any_address(self):
        self.each(lambda program: self.assertRegex(readelf(program, "--dynamic"), r"\(FLAGS_1\).*\bPIE\b"))

    def test_what_the_loader_fills_in_is_read_only_before_main(self):
        def look(program):
            self.assertIn("GNU_RELRO", readelf(program, "--segments"))
            self.assertRegex(readelf(program, "--dynamic"), r"\(FLAGS_1\).*\bNOW\b")
        self.each(look)

    def test_no_memory_is_both_written_and_executed(self):
        def look(program):
            segments = re.findall(r"^ +(LOAD|GNU_STACK) +(?:0x\w+ +){5}([R ][W ][E ])", readelf(program, "--segments"),
                                  re.MULTILINE)
            self.assertIn("GNU_STACK", dict(segments))
            self.assertIn("LOAD", dict(segments))
            for kind, access in segments:
                self.assertFalse("W" in access and "E" in access, f"{kind} {access}")
        self.each(look)

    def test_the_stack_is_guarded(self):
        self.each(lambda program: self.assertIn("__stack_chk_fail", readelf(program, "--dyn-syms")))

    def test_copies_are_checked_against_their_room(self):
        if self.configuration not in ("RelWithDebInfo", "Release", "MinSizeRel"):
            self.skipTest("there is no _FORTIFY_SOURCE without optimisation")
        self.each(lambda program: self.assertRegex(readelf(program, "--dyn-syms"), r"\b__(mem|read|recv|poll|v?snprintf)\w*_chk\b"))


if __name__ == "__main__":
    Hardening.configuration, *Hardening.programs = sys.argv[1:]
    unittest.main(argv=sys.argv[:1])
