"""What is left of the differences where each message is a write of its own: sentences made from the rows of a result."""

import statistics

from driver.figures import decisive, shown, shown_with_spread, values_of

UNBATCHED = ("one_to_one_unbatched", 16)
BURSTS = ("one_to_one", 16)
ROUND_TRIPS = {"library_round_trip": "where the system puts the processes", "library_round_trip_one_cpu": "on one processor"}
SAME = "not told from it by these runs"
HEADING = "## A write for each message"


def rows_of(rows: list[dict], scenario: str, size: int, transport: str) -> dict[str, dict]:
    """By subject."""
    wanted = (scenario, size, transport)
    return {row["subject"]: row for row in rows if (row["scenario"], row["size"], row["transport"]) == wanted}


def ratios(row: dict, other: dict, name: str) -> list[float]:
    """`other` in terms of `row`, for each round that both have."""
    theirs = {found["round"]: found for found in other["rounds"]}
    return [theirs[found["round"]][name] / found[name] for found in row["rounds"] if found["round"] in theirs and found[name]]


def times(values: list[float]) -> str:
    """'1.2 times (1.1 to 1.3)'"""
    spread = f" ({shown(min(values))} to {shown(max(values))})" if len(values) > 1 else ""
    return f"{shown(statistics.median(values))} times{spread}"


def in_order(ours: dict, others: dict[str, dict], name: str, less: str, more: str, better: str) -> str:
    """Words for each way in which others differ: `less` of those below ours, `more` of those above. Of which of these is the
    `better`, it is said also that there are none."""
    groups: dict[str, list[str]] = {less: [], more: [], SAME: []}
    for subject, row in others.items():
        values = ratios(ours, row, name)
        if values:
            low, high = decisive(values)
            way = less if high < 1 else more if low > 1 else SAME
            groups[way].append(f"{subject} {times(values)}")
    return "; ".join(f"{way}: {', '.join(found) or 'none'}" for way, found in groups.items() if found or way == better)


def peers(rows: dict[str, dict]) -> dict[str, dict]:
    return {name: row for name, row in rows.items() if name != "null" and not name.startswith("tcphub")}


def unbatched_text(rows: list[dict]) -> list[str]:
    found = rows_of(rows, *UNBATCHED, "tcp")
    if "null" not in found or "tcphub" not in found:
        return []
    null, ours, others = found["null"], found["tcphub"], peers(found)
    text = [f"With a write for each message ({UNBATCHED[0]}, {UNBATCHED[1]} bytes, TCP, at most 64 under way) the null relay takes "
            f"{shown_with_spread(null, 'cpu_ns_per_message')} ns a message, for the kernel's TCP path and nothing else. That is the floor, and no "
            f"hub is far from it: tcphub takes {times(values_of(ours, 'ratio_to_null'))} the null relay."]
    if others:
        dearest = max(others, key=lambda name: others[name]["ratio_to_null"])
        burst = rows_of(rows, *BURSTS, "tcp").get(dearest)
        in_bursts = f"; in bursts it takes {shown(burst['ratio_to_null'])} times" if burst is not None else ""
        text.append(f"The dearest, {dearest}, takes {times(values_of(others[dearest], 'ratio_to_null'))} the null relay{in_bursts}. So here no hub can "
                    "be many times cheaper than another: only a client that gathers its messages, or a Unix socket, changes that. In tcphub's cost, "
                    f"{in_order(ours, others, 'cpu_ns_per_message', 'cheaper', 'dearer', 'cheaper')}.")
    unix = rows_of(rows, *UNBATCHED, "unix").get("tcphub")
    if unix is not None and "ratio_to_null_tcp" in unix:
        text.append(f"On a Unix socket tcphub takes {times(values_of(unix, 'ratio_to_null_tcp'))} the null relay on TCP.")
    return text


def round_trip_text(rows: list[dict]) -> list[str]:
    text = []
    for scenario, where in ROUND_TRIPS.items():
        found = rows_of(rows, scenario, 16, "tcp")
        if "tcphub" not in found:
            continue
        ours, others = found["tcphub"], peers(found)
        share = ours["system_ns_per_message"] / ours["cpu_ns_per_message"]
        sentence = (f"Round trips one by one by library over TCP, {where} ({scenario}): {shown_with_spread(ours, 'messages_per_second')} messages/s "
                    f"by NIF and tcphub, and {share:.0%} of all their processor time is the kernel's.")
        if others:
            sentence += (f" In that rate, {in_order(ours, others, 'messages_per_second', 'slower', 'faster', 'faster')}; in system time a message, "
                         f"{in_order(ours, others, 'system_ns_per_message', 'cheaper', 'dearer', 'cheaper')}.")
        text.append(sentence)
    return text


def floor_text(rows: list[dict]) -> list[str]:
    """Lines of Markdown; none where nothing of it was measured."""
    paragraphs = [" ".join(unbatched_text(rows)), *round_trip_text(rows)]
    lines = [line for paragraph in paragraphs if paragraph for line in (paragraph, "")]
    return [HEADING, "", *lines] if lines else []
