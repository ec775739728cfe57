#!/usr/bin/env python3
"""What a run of worlds in which some fault never came ends with:   every_fault_test.py PROGRAM"""

import subprocess
import sys

# (arguments, ends with 1): worlds of two nodes, in which much cannot happen.
RUNS = (
    (("--seeds", "2", "--nodes", "2"), False),  # so few prove nothing
    (("--seeds", "2", "--nodes", "2", "--every-fault"), True),
    (("--nodes", "2", "--seeds", "499"), False),
    (("--nodes", "2"), True),
    (("--nodes", "2", "--without", "crash"), False),  # what is left out cannot come
)


def main():
    for arguments, fails in RUNS:
        done = subprocess.run([sys.argv[1], *arguments], capture_output=True, text=True, check=False)
        assert "never happened: " in done.stdout, done.stdout + done.stderr
        assert done.returncode == int(fails), f"{arguments} ended with {done.returncode}"


if __name__ == "__main__":
    main()
