#!/usr/bin/env python3
"""A world that breaks is shrunk to one that breaks in the same way, and the line that is printed shows it:
shrink_test.py PROGRAM CHECKER [PROGRAM CHECKER ...], programs with a planted bug."""

import re
import subprocess
import sys

SEEDS = 100
AGAIN = re.compile(r"^(again|smaller\b.*): \./dev sim (--seed \d+ --nodes (\d+)(?: --without \S+)?) --trace$", re.MULTILINE)


def run(program, *arguments):
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def main():
    for program, checker in zip(sys.argv[1::2], sys.argv[2::2]):
        status, said = run(program, "--seeds", str(SEEDS))
        found = {match[1].split(" ")[0].strip(","): match for match in AGAIN.finditer(said)}
        assert status == 1 and f"checker {checker}:" in said, said
        assert set(found) == {"again", "smaller"}, said
        first, smallest = found["again"], found["smaller"]
        assert int(smallest[3]) < int(first[3]), f"no smaller world breaks: {smallest[0]}"
        assert "--without" in smallest[2], f"no fault could be left out: {smallest[0]}"
        status, said = run(program, "--seeds", "1", *smallest[2].split())
        assert status == 1 and f"checker {checker}:" in said, f"{smallest[2]} does not break: {said}"
        print(f"{checker}: {first[2]} became {smallest[2]}")
    status, said = run(sys.argv[1], "--without", "crash,nonsense")
    assert status == 2, said


if __name__ == "__main__":
    main()
