"""Figures that need two rows of one result, made for each round in which both were measured."""

from driver.figures import pair
from driver.goals import NULL, NULL_TCP, RIVAL_FIELDS, UNIX
from driver.suite import SCENARIOS, Case

Index = dict[tuple[str, str, int, str], dict]


def key_of(row: dict) -> tuple[str, str, int, str]:
    return row["subject"], row["scenario"], row["size"], row["transport"]


def ratio(mine: dict, theirs: dict, name: str) -> float | None:
    return mine[name] / theirs[name] if name in mine and theirs.get(name) else None


def add_derived(rows: list[dict]) -> None:
    """To the rounds of each row."""
    index = {key_of(row): row for row in rows}
    for row in rows:
        add_null(row, index)
        add_seconds(row, index)
        add_idle_latency(row, index)
        add_rivals(row, index)
        add_libraries(row, rows)


def add_null(row: dict, index: Index) -> None:
    """The figure that decides, in the null relay's, and over a Unix socket also in that of the null relay on TCP."""
    baseline = Case(row["scenario"], row["size"], row["transport"]).baseline
    if baseline is None:
        return
    metric = SCENARIOS[row["scenario"]].metric
    for name, transport in ((NULL, row["transport"]), (NULL_TCP, "tcp")):
        null = index.get(("null", baseline.scenario, baseline.size, transport))
        if null is not None and (name == NULL or row["transport"] == "unix"):
            pair(row, null, name, lambda mine, theirs: ratio(mine, theirs, metric))
            row["baseline"] = baseline.scenario


def add_seconds(row: dict, index: Index) -> None:
    """How much longer than the null relay something takes."""
    null = index.get(("null", row["scenario"], row["size"], row["transport"]))
    if null is not None and row["subject"] != "null":
        pair(row, null, "seconds_over_null",
             lambda mine, theirs: mine["seconds"] - theirs["seconds"] if "seconds" in mine and "seconds" in theirs else None)


def add_idle_latency(row: dict, index: Index) -> None:
    """The 99th percentile of a ping under load, in that of the same subject without."""
    idle = index.get((row["subject"], "ping_two_cpus", row["size"], row["transport"]))
    if idle is not None and row["scenario"].startswith("ping_under"):
        pair(row, idle, "p99_over_idle", lambda mine, theirs: ratio(mine, theirs, "p99_us"))


def add_rivals(row: dict, index: Index) -> None:
    """How many times as much another hub takes for the same."""
    for rival, name in RIVAL_FIELDS.items():
        other = index.get((rival, row["scenario"], row["size"], row["transport"]))
        if other is not None:
            pair(row, other, name, lambda mine, theirs: ratio(theirs, mine, "cpu_ns_per_message"))


def add_libraries(row: dict, rows: list[dict]) -> None:
    """How a library with its hub does beside the best of the others: over TCP, and over a Unix socket also over Unix sockets."""
    if row["subject"] != "tcphub" or SCENARIOS[row["scenario"]].roles is None:
        return
    for transport, suffix in (("tcp", ""), ("unix", UNIX)):
        if not suffix or row["transport"] == transport:
            add_best(row, [other for other in rows if other["scenario"] == row["scenario"] and other["size"] == row["size"]
                           and other["transport"] == transport and other["subject"] != "tcphub"], suffix)


def add_best(row: dict, rivals: list[dict], suffix: str) -> None:
    """In terms of the best of each round: rates, and time of all processes."""
    for found in row["rounds"]:
        theirs = [each for rival in rivals for each in rival["rounds"] if each["round"] == found["round"]]
        if not theirs:
            continue
        found[f"rate_over_best{suffix}"] = found["messages_per_second"] / max(each["messages_per_second"] for each in theirs)
        for part in ("cpu", "system"):
            if least := min(each[f"{part}_ns_per_message"] for each in theirs):
                found[f"{part}_over_best{suffix}"] = found[f"{part}_ns_per_message"] / least
