"""What is left of the differences where each message is a write of its own: sentences made from the rows of a result."""

from driver.figures import decisive, ratios, shown, shown_with_spread, times, values_of

UNBATCHED = ("one_to_one_unbatched", 16)
BURSTS = ("one_to_one", 16)
ROUND_TRIPS = {"library_round_trip": "where the system puts the processes", "library_round_trip_one_cpu": "on one processor"}
SAME = "not told from it by these runs"
HEADING = "## A write for each message"


def rows_of(rows: list[dict], scenario: str, size: int, transport: str) -> dict[str, dict]:
    """By subject."""
    wanted = (scenario, size, transport)
    return {row["subject"]: row for row in rows if (row["scenario"], row["size"], row["transport"]) == wanted}


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


def null_text(null: dict, ours: dict, others: dict[str, dict]) -> str:
    return (f"With a write for each message ({UNBATCHED[0]}, {UNBATCHED[1]} bytes, TCP, at most 64 under way) the null relay takes "
            f"{shown_with_spread(null, 'cpu_ns_per_message')} ns a message. It reads once, and writes what that read found with one write. Nearly all of "
            "its cost is the kernel's path of a read, a write and a wake-up, so that a hub that merges more messages into one write is below it: it reads "
            "again before it writes, or it is so slow that messages gather meanwhile. In the null relay's cost, "
            f"{in_order(null, {'tcphub': ours} | others, 'cpu_ns_per_message', 'cheaper', 'dearer', 'cheaper')}.")


def dearest_text(rows: list[dict], others: dict[str, dict]) -> str:
    """How little apart hubs are here, if that is so: beside bursts."""
    dearest = max(others, key=lambda name: others[name]["ratio_to_null"])
    here = values_of(others[dearest], "ratio_to_null")
    burst = rows_of(rows, *BURSTS, "tcp").get(dearest, {"rounds": []})
    in_bursts = values_of(burst, "ratio_to_null")
    if not in_bursts:
        return f"The dearest other hub, {dearest}, takes {times(here)} the null relay."
    small = "Differences are small here beside those in bursts: the" if decisive(in_bursts)[0] > decisive(here)[1] else "The"
    return f"{small} dearest other hub, {dearest}, takes {times(here)} the null relay, and {times(in_bursts)} in bursts ({BURSTS[0]})."


def unbatched_text(rows: list[dict]) -> list[str]:
    found = rows_of(rows, *UNBATCHED, "tcp")
    if "null" not in found or "tcphub" not in found:
        return []
    ours, others = found["tcphub"], peers(found)
    text = [null_text(found["null"], ours, others)]
    if others:
        text += [f"In tcphub's cost, {in_order(ours, others, 'cpu_ns_per_message', 'cheaper', 'dearer', 'cheaper')}.", dearest_text(rows, others)]
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


def single_writes_text(rows: list[dict]) -> list[str]:
    """Lines of Markdown; none where nothing of it was measured."""
    paragraphs = [" ".join(unbatched_text(rows)), *round_trip_text(rows)]
    lines = [line for paragraph in paragraphs if paragraph for line in (paragraph, "")]
    return [HEADING, "", *lines] if lines else []
