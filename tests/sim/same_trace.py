#!/usr/bin/env python3
"""Do two builds of the simulation make the same of the same seeds?   same_trace.py PROGRAM OTHER_PROGRAM

Ends with 77, which ctest counts as skipped, where the other program is not there or is older than the sources."""

import subprocess
import sys
from pathlib import Path

SEEDS = 12
SKIPPED = 77
ROOT = Path(__file__).resolve().parents[2]


def hashes(program):
    done = subprocess.run([program, "--hashes", "--seeds", str(SEEDS)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{program} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout.splitlines()


def newest_source():
    folders = ("src/base", "src/proto", "src/hub", "tests/sim")
    return max(path.stat().st_mtime for folder in folders for path in (ROOT / folder).rglob("*.?pp"))


def main():
    program, other = sys.argv[1:3]
    if not Path(other).exists() or Path(other).stat().st_mtime < newest_source():
        print(f"{other} is not there, or older than the sources: ./dev build gimnet-sim")
        return SKIPPED
    ours, theirs = hashes(program), hashes(other)
    if len(ours) != SEEDS or ours != theirs:
        differing = [f"{a} in one, {b} in the other" for a, b in zip(ours, theirs) if a != b]
        print("seed and hash differ:", *differing, sep="\n")
        return 1
    print(f"{SEEDS} seeds, the same hashes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
