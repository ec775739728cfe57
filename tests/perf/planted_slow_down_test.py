#!/usr/bin/env python3
"""The gate on instructions finds a planted slow-down of a twentieth, and nothing where nothing is: planted_slow_down_test.py
BUILD_FOLDER. Ends with 77 where instructions cannot be counted."""

import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "perf"))

from driver import instructions  # noqa: E402

LIST = ROOT / "perf" / "instructions" / "planted_bugs.txt"


def scripts_with_bug() -> list[tuple[str, str]]:
    """The programs with a bug, each with the script that finds it."""
    lines = [line.split() for line in LIST.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return [(f"instruction_scripts_{words[0].lower()}", words[1]) for words in lines]


def main() -> int:
    folder = pathlib.Path(sys.argv[1]).resolve() / "bin"
    bugs = scripts_with_bug()
    assert bugs, f"{LIST} lists nothing"
    scripts = sorted({script for _, script in bugs})
    try:
        made_by, _ = instructions.describe(folder / "instruction_scripts")
        if made_by["build"] != "release":
            raise instructions.NotCountable("a build without optimisation says nothing of a twentieth")
        clean = {script: instructions.count(folder / "instruction_scripts", script)[0] for script in scripts}
        budget = {"instructions_per_frame": clean}
        planted = [verdict for program, script in bugs
                   for verdict in instructions.measure(folder / program, [script], budget)]
        again = instructions.measure(folder / "instruction_scripts", scripts, budget)
    except instructions.NotCountable as error:
        print(f"SKIPPED: {error}")
        return 77
    for verdict in planted + again:
        print(verdict)
    assert all(verdict.is_slower and verdict.change < 0.20 for verdict in planted), "not found, or no twentieth any more"
    assert not any(verdict.is_slower or verdict.is_faster for verdict in again), "the same program counted differently"
    return 0


if __name__ == "__main__":
    sys.exit(main())
