#!/usr/bin/env python3
"""Whatever strangers pile up costs no more for each piece, however much of it there is: growth_test.py BUILD_FOLDER. Counts
instructions, so nothing depends on the machine's speed. Ends with 77 where they cannot be counted."""

import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "perf"))

from driver import instructions  # noqa: E402

# Script: few, many, and how many times more a piece may cost among many. Names are found in a tree: among a hundred times
# as many they are seven comparisons deeper. Of parts of a pattern each is compared with each of the name, 16 x 16 at most.
# A hub of 10 nodes and one of 10,000 forward to eight of them at the same cost. Taking from one queue costs the same beside
# 10,000 others.
SCRIPTS = {
    "forwarding": (800, 800_000, 1.02),
    "duplicate_keys": (1_000, 100_000, 1.2),
    "long_keys": (40, 4_000, 1.2),
    "nested_bomb": (1_000, 100_000, 1.2),
    "names": (1_000, 100_000, 2.5),
    "topics": (1_000, 100_000, 2.5),
    "remembered_names": (100, 4_000, 2.5),
    "pauses": (100, 10_000, 2.5),
    "acks": (100, 10_000, 2.5),
    "wrong_tokens": (1, 32, 1.02),
    "subscribers": (50, 1_500, 1.6),
    "retained": (100, 10_000, 1.6),
    "neighbours": (40, 1_000, 1.5),
    "patterns": (10, 1_000, 1.2),
    "pattern_parts": (2, 16, 16),
    "queues": (100, 10_000, 1.02),
    "wait_set": (100, 10_000, 1.02),
}


def main() -> int:
    program = pathlib.Path(sys.argv[1]).resolve() / "bin" / "growth_scripts"
    try:
        _, scripts = instructions.describe(program)
        assert set(scripts) == set(SCRIPTS), scripts
        worse = []
        for script, (few, many, times) in SCRIPTS.items():
            small = instructions.count(program, f"{script}:{few}")[0]
            large = instructions.count(program, f"{script}:{many}")[0]
            print(f"{script:16} {few:7}: {small:9.1f} a piece   {many:7}: {large:9.1f}   {large / small:5.2f} times")
            if large > small * times:
                worse.append(script)
    except instructions.NotCountable as error:
        print(f"SKIPPED: {error}")
        return 77
    assert not worse, f"grow faster than they may: {', '.join(worse)}"
    return 0


if __name__ == "__main__":
    sys.exit(main())
