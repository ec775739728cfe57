#!/usr/bin/env python3
"""Each checker of the simulation has a planted bug that it must find:   planted_bugs_test.py PROGRAM PLANTED_BUGS"""

import subprocess
import sys
from pathlib import Path


def main():
    program, planted = sys.argv[1:3]
    answer = subprocess.run([program, "--checkers"], capture_output=True, text=True, check=True)
    checkers = set(answer.stdout.split())
    lines = [line.split() for line in Path(planted).read_text(encoding="utf-8").splitlines()]
    found = {words[2] for words in lines if words and not words[0].startswith("#")}
    for name in sorted(checkers - found):
        print(f"no bug is planted for the checker {name}")
    for name in sorted(found - checkers):
        print(f"there is no checker {name}")
    return 0 if checkers == found else 1


if __name__ == "__main__":
    sys.exit(main())
