"""From outcomes to the rows of the JSON document and of the table."""

from driver.derived import add_derived
from driver.figures import shown, summarise
from driver.outcome import Outcome


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
