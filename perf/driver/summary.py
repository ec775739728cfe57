"""From outcomes to the rows of the JSON document and of the table."""

import statistics

from driver.measure import Outcome
from driver.suite import Case

COUNTED = ("lost", "wrong", "dropped_frames", "ledger_gap")


def median_of(outcome: Outcome, name: str) -> float | None:
    values = [found[name] for found in outcome.findings if name in found]
    return statistics.median(values) if values else None


def make_row(outcome: Outcome, baseline: Outcome | None, null_tcp: Outcome | None) -> dict:
    """`min`, `max` and `ratio_to_null` are of the figure that `metric` names."""
    case = outcome.case
    metric = case.spec.metric
    values = [found[metric] for found in outcome.findings]
    row = {"subject": outcome.subject, "transport": case.transport, "scenario": case.scenario, "size": case.size,
           "cpu_ns_per_message": None, "ratio_to_null": None, "messages_per_second": None}
    for name in outcome.findings[0]:
        if name in COUNTED:
            row[name] = int(sum(found[name] for found in outcome.findings))
        else:
            row[name] = median_of(outcome, name)
    row |= {"metric": metric, "runs": len(values), "min": min(values), "max": max(values)}
    if baseline is not None and (of_null := median_of(baseline, metric)):
        row["ratio_to_null"] = statistics.median(values) / of_null
        row["baseline"] = baseline.case.scenario
    if null_tcp is not None and (of_null := median_of(null_tcp, metric)):
        row["ratio_to_null_tcp"] = statistics.median(values) / of_null
    return row


def make_rows(outcomes: list[Outcome]) -> list[dict]:
    nulls = {outcome.case: outcome for outcome in outcomes if outcome.subject == "null" and outcome.findings}
    rows = []
    for outcome in outcomes:
        if not outcome.findings:
            continue
        case = outcome.case
        baseline = nulls.get(case.baseline) if case.baseline is not None else None
        null_tcp = None
        if case.transport == "unix" and case.baseline is not None:
            null_tcp = nulls.get(Case(case.baseline.scenario, case.size, "tcp"))
        rows.append(make_row(outcome, baseline, null_tcp))
    return rows


def make_absences(outcomes: list[Outcome]) -> list[dict]:
    """Cases without a row, and why."""
    return [{"subject": outcome.subject, "transport": outcome.case.transport, "scenario": outcome.case.scenario,
             "size": outcome.case.size, "reason": outcome.error}
            for outcome in outcomes if outcome.error is not None and not outcome.findings]


def shown(value: float | None) -> str:
    """Three digits that matter, without an exponent."""
    if value is None:
        return ""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}"


COLUMNS = (("subject", "subject"), ("transport", "transport"), ("scenario", "scenario"), ("size", "size"),
           ("cpu_ns_per_message", "CPU ns/message"), ("ratio_to_null", "x null"), ("min", "min"), ("max", "max"),
           ("messages_per_second", "messages/s"), ("p50_us", "p50 us"), ("p99_us", "p99 us"),
           ("p999_us", "p99.9 us"), ("rss_peak_bytes", "peak bytes"), ("lost", "lost"))


def cells(row: dict) -> list[str]:
    return [str(row[key]) if isinstance(row.get(key), (str, int)) else shown(row.get(key)) for key, _ in COLUMNS]


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
