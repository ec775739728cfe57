"""From what the runs found to the rows of the JSON document: figures that need two rows, medians, spreads, and what is wrong.

A row keeps its runs in `rounds`, a dictionary of figures each, with the number of the round under `round`. What is compared was measured
in the same round: a ratio is made a round, and the median is taken of the ratios."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass, field

from driver.suite import BROKERS, CPU, NULL, NULL_TCP, SCENARIOS, UNIX, Case, decisive

COUNTED = ("lost", "wrong", "dropped_frames", "ledger_gap")
Index = dict[tuple[str, str, int, str], dict]


@dataclass
class Outcome:
    """What the runs of one case on one subject found, or why there is nothing."""

    subject: str
    case: Case
    findings: list[dict[str, float]] = field(default_factory=list)
    error: str | None = None
    is_absent: bool = False  # `error` says why it was not even tried
    rounds: list[int] = field(default_factory=list)  # of each finding: what has the same number can be compared

    def __post_init__(self) -> None:
        self.rounds = self.rounds or list(range(len(self.findings)))

    def add(self, number: int, found: dict[str, float]) -> None:
        self.rounds.append(number)
        self.findings.append(found)


def values_of(row: dict, name: str) -> list[float]:
    return [found[name] for found in row["rounds"] if name in found]


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
        add_libraries(row, rows)
        add_beside(row, index)


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


def add_libraries(row: dict, rows: list[dict]) -> None:
    """How a library with its hub does beside the best of the others: over TCP, and over a Unix socket also over Unix sockets."""
    if row["subject"] != "tcphub" or SCENARIOS[row["scenario"]].roles is None:
        return
    for transport, suffix in (("tcp", ""), ("unix", UNIX)):
        if not suffix or row["transport"] == transport:
            add_best(row, [other for other in rows if other["scenario"] == row["scenario"] and other["size"] == row["size"]
                           and other["transport"] == transport and other["subject"] in BROKERS], suffix)


def add_beside(row: dict, index: Index) -> None:
    """Bursts beside those without a hub, and over a Unix socket beside those over TCP."""
    if row["subject"] == "tcphub" and row["scenario"] == "library_burst":
        for subject, name, metric in (("cyclonedds", "cpu_over_dds", CPU), ("tcphub", "rate_over_tcp", "messages_per_second")):
            other = index.get((subject, row["scenario"], row["size"], "tcp"))
            if other is not None and other is not row:
                pair(row, other, name, lambda mine, theirs: ratio(mine, theirs, metric))


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


def make_row(outcome: Outcome) -> dict:
    """`rounds` are its runs as they were; figures that need two rows, and medians, come later."""
    case = outcome.case
    return {"subject": outcome.subject, "transport": case.transport, "scenario": case.scenario, "size": case.size,
            "cpu_ns_per_message": None, "ratio_to_null": None, "messages_per_second": None, "metric": case.spec.metric,
            "rounds": [{"round": number} | found for number, found in zip(outcome.rounds, outcome.findings, strict=True)]}


def make_rows(outcomes: list[Outcome]) -> list[dict]:
    """`min` and `max` are of the figure that `metric` names; `spread` has those of all."""
    rows = [make_row(outcome) for outcome in outcomes if outcome.findings]
    add_derived(rows)
    rows = [summarise(row) for row in rows]
    for row in rows:
        row["min"], row["max"] = row["spread"][row["metric"]]
    return rows


def make_absences(outcomes: list[Outcome]) -> list[dict]:
    """Cases without a row, and why."""
    return [{"subject": outcome.subject, "transport": outcome.case.transport, "scenario": outcome.case.scenario,
             "size": outcome.case.size, "reason": outcome.error}
            for outcome in outcomes if outcome.error is not None and not outcome.findings]


COLUMNS = (("subject", "subject"), ("transport", "transport"), ("scenario", "scenario"), ("size", "size"),
           ("cpu_ns_per_message", "CPU ns/message"), ("ratio_to_null", "x null"), ("min", "min"), ("max", "max"),
           ("messages_per_second", "messages/s"), ("p50_us", "p50 us"), ("p99_us", "p99 us"),
           ("p999_us", "p99.9 us"), ("rss_peak_bytes", "peak bytes"), ("lost", "lost"), ("runs", "runs"))


def cells(row: dict) -> list[str]:
    return [row[key] if isinstance(row.get(key), str) else shown(row.get(key)) for key, _ in COLUMNS]


def absence_lines(absences: list[dict]) -> list[str]:
    """A line for each subject and reason, with the cases that it keeps out."""
    cases: dict[tuple[str, str], list[str]] = {}
    for each in absences:
        name = f"{each['scenario']} {each['size']} B {each['transport']}"
        cases.setdefault((each["subject"], each["reason"]), []).append(name)
    return [f"{subject}: {', '.join(names) if len(names) <= 3 else f'{len(names)} cases'}: {reason}"
            for (subject, reason), names in cases.items()]


def text_table(rows: list[dict]) -> str:
    lines = [[title for _, title in COLUMNS]] + [cells(row) for row in rows]
    widths = [max(len(line[column]) for line in lines) for column in range(len(COLUMNS))]
    return "\n".join("  ".join(cell.ljust(width) if column in (0, 1, 2) else cell.rjust(width)
                               for column, (cell, width) in enumerate(zip(line, widths))) for line in lines)


@dataclass(frozen=True)
class Fault:
    is_error: bool  # otherwise it is only said
    sentence: str

    def __str__(self) -> str:
        return f"{'error' if self.is_error else 'warning'}: {self.sentence}"


def faults_of(where: str, counted: dict[str, float], is_ours: bool = True, is_smoke: bool = False) -> list[Fault]:
    """`counted` are the sums of runs. What other hubs do is said, but is not our failure; what is lost is one in a smoke run only."""
    faults = []
    if counted.get("wrong"):
        faults.append(Fault(is_ours or is_smoke, f"{where}: {counted['wrong']:.0f} messages arrived that were not sent so"))
    if counted.get("ledger_gap"):
        faults.append(Fault(True, f"{where}: the hub's ledger does not explain {counted['ledger_gap']:.0f} frames"))
    if counted.get("lost"):
        faults.append(Fault(is_ours and is_smoke, f"{where}: {counted['lost']:.0f} messages were lost"))
    return faults
