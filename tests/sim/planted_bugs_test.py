#!/usr/bin/env python3
"""Each checker of the simulation has a planted bug that it must find: planted_bugs_test.py PROGRAM FOLDER_OF_PLANTED"""

import pathlib
import subprocess
import sys


def main():
    program, folder = sys.argv[1:3]
    sys.path.insert(0, folder)
    import planted  # noqa: PLC0415: its folder is an argument

    answer = subprocess.run([program, "--checkers"], capture_output=True, text=True, check=True)
    checkers = set(answer.stdout.split())
    found = {bug.argument for bug in planted.load() if bug.program == pathlib.Path(program).name}
    for name in sorted(checkers - found):
        print(f"no bug is planted for the checker {name}")
    for name in sorted(found - checkers):
        print(f"there is no checker {name}")
    return 0 if checkers == found else 1


if __name__ == "__main__":
    sys.exit(main())
