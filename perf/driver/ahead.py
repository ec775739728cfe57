"""Where another hub is better than tcphub by the figures that decide: a list made from the rows of a result."""

import statistics

from driver.figures import decisive, ratios, shown, shown_with_spread, values_of
from driver.goals import RIVAL_FIELDS
from driver.markdown import table
from driver.suite import CPU, SCENARIOS

HEADING = "## Where another hub is ahead"
ROUND_TRIPS = ("p50_us", "p99_us")
RATE = "messages_per_second"  # the only one of which more is better
TITLES = {CPU: "CPU ns a message", "p50_us": "round trip, us, median", "p99_us": "round trip, us, 99th percentile", "seconds": "seconds",
          "rss_bytes_per_connection": "resident bytes a connection", "context_switches_per_second": "context switches/s", RATE: "messages/s"}
WHAT = f"""A line for each case and figure in which another hub ({', '.join(RIVAL_FIELDS)}) is better than `tcphub` in every round, over the same transport;
where there are nine rounds or more, the best and the worst do not count. The figure is the one that decides in its scenario (that of `x null` below); of
round trips the median and the 99th percentile, of libraries also the rate. In what is not listed tcphub is ahead, or the runs do not tell the two
apart; which hubs were measured in a case is under "All figures"."""


def figures_of(scenario: str) -> tuple[str, ...]:
    """Those that decide."""
    spec = SCENARIOS[scenario]
    figures = ROUND_TRIPS if spec.metric in ROUND_TRIPS else (spec.metric,)
    return figures if spec.roles is None else (*figures, RATE)


def is_ahead(ours: dict, other: dict, name: str) -> bool:
    """In every round that counts."""
    if 0 in values_of(ours, name):
        return False  # nothing is less, and no rate is nothing
    values = ratios(ours, other, name)
    if not values:
        return False
    low, high = decisive(values)
    return low > 1 if name == RATE else high < 1


def cells(ours: dict, other: dict, name: str) -> list[str]:
    return [ours["scenario"], str(ours["size"]), ours["transport"], TITLES[name], other["subject"], shown_with_spread(other, name),
            shown_with_spread(ours, name), shown(statistics.median(ratios(ours, other, name)))]


def ahead_lines(rows: list[dict]) -> list[str]:
    """A section; nothing where no other hub was measured beside ours."""
    cases = {(row["scenario"], row["size"], row["transport"]): row for row in rows if row["subject"] == "tcphub"}
    pairs = [(ours, other) for case, ours in cases.items() for other in rows
             if other["subject"] in RIVAL_FIELDS and (other["scenario"], other["size"], other["transport"]) == case]
    if not pairs:
        return []
    lines = [cells(ours, other, name) for ours, other in pairs for name in figures_of(ours["scenario"])
             if all(name in found for row in (ours, other) for found in row["rounds"]) and is_ahead(ours, other, name)]
    titles = ["scenario", "bytes", "transport", "figure", "other hub", "its figure", "that of tcphub", "times that of tcphub"]
    return [HEADING, "", WHAT, "", table(titles, lines) if lines else "There is none.", ""]
