"""docs/performance.md from the JSON document of a run."""

import pathlib

from driver import control, yardstick
from driver.ahead import ahead_lines
from driver.figures import shown, shown_with_spread
from driver.markdown import table
from driver.repetition import APART_MAX
from driver.single_writes import single_writes_text
from driver.suite import SCENARIOS
from driver.summary import DOCUMENT_COLUMNS, absence_lines, document_cells
from driver.verdicts import EXPLANATION, goal_table

FINDINGS = pathlib.Path(__file__).resolve().parent.parent / "findings.md"
INTRODUCTION = """# Performance

What the hub costs, measured against the cheapest relay that there can be and against other hubs. This page is written by `./dev perf --report`;
nothing here is edited by hand, but for the findings, which are those of `perf/findings.md`; the control plane's figures are kept in `perf/control.json`.

## The yardstick

**Null relay** (`perf/null_relay.cpp`): one thread, epoll, `recv` into a buffer of 256 KiB, `send` of the same bytes, no parsing,
with the hub's socket options and on the hub's processor. It moves connection 2k to 2k+1, or connection 0 to all others, and it is given
byte for byte the frames that the hub is given. **Cost** is the processor time (user and system) of the measured process
divided by the messages that arrived; every message is compared byte for byte at its receiver, and what did not arrive is counted. The subject has one
processor for itself and the generator another, except in `ping_one_cpu`. Each run has a fresh process. A round is one run of each subject,
one right after the other, and every second round goes the other way; what is compared with each other is compared within each round, and the median is taken of
the ratios. Where the runs of a subject lie more than 1.5 times apart, or some meet a goal and others do not, it is run up to nine times, with
those that it is compared with, as far as there is time. What is measured is `build/release/bin/tcphub` as it starts by default. Absolute figures differ from
machine to machine; the ratios of one run are what counts.

At most 2 MiB are under way (128 KiB a recipient in fan-outs to more than 16), so that nobody is measured while it drops. Messages over 4 KiB travel in
fragments of 32 KiB. A publisher writes 64 KiB with one system call, in whole messages, unless the name says `unbatched`.

To stay within an hour, a whole run leaves out one_to_one_unbatched at 64 KiB and 1 MiB, where one_to_one writes each message by itself, too; fan_out_1000,
list_100 and broadcast_100 but for 16 and 1,024 bytes, since fan_out_10 and fan_out_100 show what size does; two shards over Unix sockets; spinning but at 16
bytes, where a wake-up weighs most; and of other hubs over Unix sockets all but what goes between two. `--scenario NAME --size BYTES` measures other sizes, of
all subjects.

**Other hubs** (`perf/driver/rivals.py`): Debian's packages as their documentation would have them for messages that need not be kept, and in their favour:
nothing on disk, no passwords, TCP_NODELAY; nats-server; mosquitto at QoS 0; redis-server with RESP 3 and without replies to PUBLISH; ZeroMQ's XPUB/XSUB
proxy that drops nothing. One raw generator speaks each one's protocol, so that every subject sees the same client. `tcphub_2_shards` has
a second shard, on a processor of its own where the generator leaves one; `tcphub_spinning` is started with `--spin`.

**Libraries** (`perf/library`): two programs and a hub, each a process; the programs use the library that comes with the hub, in the same way and in its favour: NIF with its callback
and without resume; nats.c, which gathers bursts by itself and sends single messages at once (`SendAsap`); libmosquitto at QoS 0 with its loop in the main
thread, so that no publish wakes another one. Cost is that of all three processes.

| scenario | what happens |
| --- | --- |
| one_to_one | one node sends to another |
| one_to_one_unbatched | a system call for each message |
| four_to_four | four such pairs |
| in_turns | one node sends each message to another of 8 nodes; compared with the one_to_one null relay |
| fan_out_N | a service with N subscribers; compared with a null relay that sends to all |
| list_100, broadcast_100 | the same by recipient list, and by broadcast to all nodes of the hub; compared with the null fan_out_100 |
| ping_one_cpu | round trips of 16 B, generator and hub on one processor: the software's path without idle wake-ups |
| ping_two_cpus, ping_paced | round trips between two processors, without a pause, and at 1 kHz |
| ping_under_bulk, ping_under_300MBps | round trips in lane 0 while another pair moves 64 KiB messages in lane 2, at full speed and at 300 MB/s; lanes are tcphub's alone: other hubs have none, and ping and bulk share what they have |
| stalled_subscriber | a service at line rate: one subscriber, and the same with another one that does not read, in turns |
| idle_10000 | 10,000 nodes that say nothing but keep-alives, each 0.9 s; and then five rounds of keep-alives without a pause, to know what one costs |
| idle_alone | nobody is connected |
| connect_10000 | the time until 10,000 nodes have joined, and a message has gone through the last two |
| join_under_load | the time until 1,000 nodes have joined while one_to_one goes on, and what is left of its rate |
| ping_beside_joins | round trips of two nodes while 1,000 others join, and without that (`_alone`) |
| library_burst | one program sends to another as fast as its library takes it, at most 16,384 messages or 2 MiB under way |
| library_round_trip | a program answers each message of another; processes run where the system puts them |
| library_round_trip_one_cpu | the same on one processor: the software's path without idle wake-ups |
"""


def other_figures(rows: list[dict]) -> str:
    """Memory, rates and times that have no column of their own."""
    names = {"rate_kept": "rate kept", "rss_growth_bytes": "bytes grown by meanwhile",
             "publisher_pause_ms": "longest time without a write, ms",
             "publisher_pause_ms_alone": "longest time without a write, alone, ms",
             "rss_bytes_per_connection": "resident bytes a connection", "seconds": "seconds",
             "cpu_ns_per_connection": "CPU ns a connection", "bulk_bytes_per_second": "bulk bytes/s",
             "cpu_share": "of a processor used", "context_switches_per_second": "context switches/s",
             "keep_alives_per_second": "keep-alives/s, word and answer", "keep_alive_ns": "CPU ns a keep-alive",
             "keep_alive_ns_busy": "CPU ns a keep-alive, one round after the other",
             "cpu_share_beyond_keep_alives": "of a processor used beyond keep-alives"}
    lines = [[row["subject"], row["transport"], row["scenario"], title, shown_with_spread(row, name)] for row in rows
             for name, title in names.items() if name in row and (name != "cpu_share" or row["scenario"].startswith("idle"))]
    return table(["subject", "transport", "scenario", "figure", "median"], lines)


def library_figures(rows: list[dict]) -> str:
    """CPU of both programs and the hub, apart."""
    parts = ["sender_user", "sender_system", "receiver_user", "receiver_system", "hub_user", "hub_system", "system"]
    titles = ["subject", "transport", "scenario", "size", "messages/s", *(f"{part.replace('_', ' ')} ns" for part in parts[:-1]),
              "all system ns", "all CPU ns"]
    lines = [[row["subject"], row["transport"], row["scenario"], str(row["size"]), shown_with_spread(row, "messages_per_second"),
              *(shown_with_spread(row, f"{part}_ns_per_message") for part in parts), shown_with_spread(row, "cpu_ns_per_message")]
             for row in rows if "system_ns_per_message" in row]
    return table(titles, lines)


def runs_of(result: dict) -> str:
    """How many runs, and how long."""
    wild = f", up to {result['runs_max']} where they lie more than {APART_MAX} times apart or do not agree on a goal" if result["runs_max"] > result["runs"] else ""
    lengths = ", ".join(longer_runs(result))
    runs = "one run" if result["runs"] == 1 else f"{result['runs']} runs"
    return f"{runs}{wild}, of {result['seconds']} s each" + (f" ({lengths} s)" if lengths else "")


def longer_runs(result: dict) -> list[str]:
    """What was measured longer, of what was measured."""
    measured = {(row["scenario"], row["size"], row["transport"], row["subject"]) for row in result["results"]}
    scenarios = {scenario for scenario, *_ in measured}
    longer = [f"{name} {shown(result['seconds'] * spec.seconds_factor)}" for name, spec in SCENARIOS.items()
              if spec.seconds_factor != 1 and name in scenarios]
    for scenario, size, transport, seconds, subjects in result.get("longer", []):
        if there := [name for name in subjects if (scenario, size, transport, name) in measured]:
            longer.append(f"{scenario} {size} B {transport} of {', '.join(there)} {shown(seconds)}")
    return longer


def make_document(result: dict, pictures: list[str] | None = None) -> str:
    """`pictures`: links in Markdown."""
    rows = result["results"]
    machine = result["machine"]
    hub = " ".join(result["hub_arguments"]) or "none"
    versions = "".join(f"; {name} {version}" for name, version in result.get("versions", {}).items())
    return "\n".join([
        INTRODUCTION,
        "## Where and when", "",
        f"{result['date']}; {machine['processor']}, {machine['cpus_allowed']} processors, {machine['system']}, "
        f"Linux {machine['kernel']}; GIMnet {result.get('version', '')}{versions}; {runs_of(result)}; "
        f"further arguments of the hub: {hub}.", "",
        "## The machine", "",
        yardstick.EXPLANATION, "",
        yardstick.yardstick_table(rows), "",
        "## Bounds and goals", "",
        EXPLANATION, "",
        goal_table(rows), "",
        *ahead_lines(rows),
        *single_writes_text(rows),
        *(["## Pictures", "", *(line for link in pictures for line in (link, ""))] if pictures else []),
        FINDINGS.read_text(),
        *control.section_lines(),
        *control.bystanders_lines(rows),
        "## All figures", "",
        "Medians of the runs, with the smallest and the largest. `x null` is of the CPU cost; of the median round trip for pings, of its 99th",
        "percentile for pings under bulk; of bytes a connection for idle_10000, of context switches for idle_alone, and of seconds for",
        "connect_10000 and join_under_load. Peak bytes are the hub's. The CPU of library scenarios is that of hub and programs together, in round trips for each way.", "",
        table([title for _, title in DOCUMENT_COLUMNS], [document_cells(row) for row in rows]), "",
        other_figures(rows), "",
        "## Libraries", "",
        "Processor time a message of the two programs and of the hub; in round trips each way is a message.", "",
        library_figures(rows), "",
        *[f"No row: {line}." for line in absence_lines(result.get("absent", []))], ""])
