"""Which arguments of ./dev perf make sense, alone and together: what would be ignored is refused before anything is built."""

import argparse
import math
from collections.abc import Callable

# What each way to run takes; without one of these names the suite is measured, which takes all but --update.
ALWAYS = ("packages", "build_dir")
TAKEN_BY = {
    "--instructions": ("instructions", "update", *ALWAYS),
    "--control": ("control", "report", *ALWAYS),
    "--against": ("against", "json", "scenario", "size", "transport", "seconds", "runs", "hub_argument", *ALWAYS),
}


def positive_whole(text: str) -> int:
    """For argparse."""
    if not text.isascii() or not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number above 0")
    return int(text)


def positive_seconds(text: str) -> float:
    """For argparse."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value <= 0:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds above 0")
    return value


def mode_of(arguments: argparse.Namespace) -> str | None:
    """None: the suite is measured."""
    if arguments.instructions is not None:
        return "--instructions"
    if arguments.control:
        return "--control"
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
    if arguments.smoke and arguments.report:
        return "--smoke measures nothing that --report could write"
    return None


def flag(name: str) -> str:
    return "--" + name.replace("_", "-")
