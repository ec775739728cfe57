#!/usr/bin/env python3
"""The gate on instructions, with the budget that is committed, finds a planted slow-down of a twentieth, and nothing where nothing is:
planted_slow_down_test.py BUILD_FOLDER. Ends with 77 where instructions cannot be counted."""

import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "perf"))

from driver import instructions  # noqa: E402

# What a planted bug adds, so that what is shown is that a twentieth is found, and not a half. Its source is compiled apart from the library's,
# which by itself is up to 2 % either way.
LEAST, MOST = 0.03, 0.08
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
        budget = instructions.load_budget()
        instructions.require_comparable(made_by, budget)
        planted = [verdict for program, script in bugs
                   for verdict in instructions.measure(folder / program, [script], budget)]
        clean = {verdict.script: verdict for verdict in instructions.measure(folder / "instruction_scripts", scripts, budget)}
        again = instructions.measure(folder / "instruction_scripts", scripts, budget)
    except instructions.NotCountable as error:
        print(f"SKIPPED: {error}")
        return 77
    added = [verdict.counted / clean[verdict.script].counted - 1 for verdict in planted]
    for (program, _), verdict, more in zip(bugs, planted, added):
        print(f"{program:34} {more:+6.2%}  {verdict}")
    assert all(verdict.is_slower for verdict in planted), "not found: is the budget above what the scripts take today?"
    assert all(LEAST < more < MOST for more in added), "no twentieth any more"
    assert not any(verdict.is_slower for verdict in clean.values()), "found where nothing is planted"
    assert again == list(clean.values()), "the same program counted differently"
    return 0


if __name__ == "__main__":
    sys.exit(main())
