"""Which arguments of ./dev perf make sense, alone and together: what would be ignored is refused before anything is built."""

import argparse
import math
from collections.abc import Callable

# What each way to run takes; without one of these names the suite is measured, which takes all but --update.
ALWAYS = ("packages", "build_dir")
TAKEN_BY = {
    "--instructions": ("instructions", "update", *ALWAYS),
    "--control": ("control", "report", *ALWAYS),
    "--network": ("network", "report", *ALWAYS),
    "--python": ("python", "report", *ALWAYS),
    "--against": ("against", "json", "scenario", "size", "transport", "seconds", "runs", "hub_argument", *ALWAYS),
}
# What makes a run a part of the suite.
PARTS = ("quick", "scenario", "size", "transport", "subjects")
# The bounds of the generator (perf/generator/messages.hpp, perf/load_generator.cpp), which measures no scenario for more
# than an hour: some take eight times --seconds.
SIZE_MIN, SIZE_MAX = 16, 1_048_576
SECONDS_MIN, SECONDS_MAX = 0.01, 450


def positive_whole(text: str) -> int:
    """For argparse."""
    if not text.isascii() or not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number above 0")
    return int(text)


def payload_bytes(text: str) -> int:
    """For argparse."""
    value = positive_whole(text)
    if not SIZE_MIN <= value <= SIZE_MAX:
        raise argparse.ArgumentTypeError(f"'{text}' is not a size that can be measured: give {SIZE_MIN} to {SIZE_MAX:,} bytes")
    return value


def seconds(text: str) -> float:
    """For argparse."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not SECONDS_MIN <= value <= SECONDS_MAX:
        raise argparse.ArgumentTypeError(f"'{text}' is not a length that can be measured: give {SECONDS_MIN} to {SECONDS_MAX} seconds")
    return value


def mode_of(arguments: argparse.Namespace) -> str | None:
    """None: the suite is measured."""
    if arguments.instructions is not None:
        return "--instructions"
    for mode in ("control", "network", "python"):
        if getattr(arguments, mode):
            return flag(mode)
    return "--against" if arguments.against is not None else None


def find_wrong(arguments: argparse.Namespace, default_of: Callable[[str], object]) -> str | None:
    """Why these do not go together; None: they do."""
    given = [name for name, value in vars(arguments).items() if value != default_of(name)]
    mode = mode_of(arguments)
    for name in given:
        if mode is not None and name not in TAKEN_BY[mode]:
            return f"{flag(name)} means nothing with {mode}, which takes {', '.join(map(flag, TAKEN_BY[mode][1:]))}"
    if "update" in given and (mode is None or arguments.instructions):
        return "--update goes with --instructions, of all scripts"
    if arguments.quick and arguments.smoke:
        return "--quick and --smoke are two different runs"
    chosen = [name for name in given if name in ("scenario", "size", "transport")]
    if chosen and (arguments.quick or arguments.smoke):
        which = flag("quick" if arguments.quick else "smoke")
        return f"{which} is a choice of scenarios of its own: leave out {which}, or {', '.join(map(flag, chosen))}"
    if arguments.smoke and arguments.report:
        return "--smoke measures nothing that --report could write"
    parts = [flag(name) for name in given if name in PARTS]
    if arguments.report and parts:
        return (f"--report replaces the figures of docs/performance.md, and {' and '.join(parts)} would leave most of it out: keep the result "
                "with --json >RESULT.json, and make a page of its own with perf/report.py RESULT.json OTHER.md")
    return None


def flag(name: str) -> str:
    return "--" + name.replace("_", "-")
