"""Tests that cannot run everywhere, and say so."""

import sys
import unittest

SKIPPED = 77  # as ctest is told


def main():
    """As unittest.main(); the program ends with SKIPPED, and the reasons, if nothing failed and something was skipped."""
    program = unittest.main(exit=False)
    if program.result.wasSuccessful() and program.result.skipped:
        for _, reason in program.result.skipped:
            print(f"SKIPPED: {reason}", file=sys.stderr)
        sys.exit(SKIPPED)
    sys.exit(not program.result.wasSuccessful())
