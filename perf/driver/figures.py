"""What several runs say of one figure: the median, how far they lie apart, and whether that decides anything.

A row keeps its runs in `rounds`, a dictionary of figures each, with the number of the round under `round`. What is
compared was measured in the same round: a ratio is made a round, and the median is taken of the ratios."""

import statistics
from collections.abc import Callable

COUNTED = ("lost", "wrong", "dropped_frames", "ledger_gap")
# From so many runs on the smallest and the largest are left out: in nine, the median of all that there could be lies
# between the second and the eighth with 96 % probability, while the two outermost are whatever the machine did then.
RUNS_TO_TRIM = 9


def values_of(row: dict, name: str) -> list[float]:
    return [found[name] for found in row["rounds"] if name in found]


def median_of(row: dict, name: str) -> float | None:
    values = values_of(row, name)
    return statistics.median(values) if values else None


def decisive(values: list[float]) -> tuple[float, float]:
    """Between which two values what is measured is taken to lie. REQUIRES: at least one."""
    ordered = sorted(values)
    return (ordered[1], ordered[-2]) if len(ordered) >= RUNS_TO_TRIM else (ordered[0], ordered[-1])


def pair(row: dict, other: dict, name: str, combine: Callable[[dict, dict], float | None]) -> None:
    """Gives each round of `row` the figure `name`, where the other was measured in that round too."""
    theirs = {found["round"]: found for found in other["rounds"]}
    for found in row["rounds"]:
        if found["round"] in theirs and (value := combine(found, theirs[found["round"]])) is not None:
            found[name] = value


def summarise(row: dict) -> dict:
    """Adds to a row what its runs say: medians, [min, max] of each under `spread`, sums of what is counted."""
    names = dict.fromkeys(name for found in row["rounds"] for name in found if name != "round")
    summary: dict = {}
    spread = {}
    for name in names:
        values = values_of(row, name)
        if name in COUNTED:
            summary[name] = int(sum(map(abs, values)))  # a gap may be either way
        else:
            summary[name] = statistics.median(values)
            spread[name] = [min(values), max(values)]
    return row | summary | {"runs": len(row["rounds"]), "spread": spread}


def shown(value: float | None) -> str:
    """Three digits that matter, without an exponent."""
    if value is None:
        return ""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}"
