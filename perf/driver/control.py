"""What the control plane takes: how long until everybody is back after kill -9, how the work on names and services grows with
their number, how soon the tool answers. `./dev perf --control` measures it and keeps it in perf/control.json; docs/performance.md
has it as a section. What bystanders notice of joins every run measures: that is the next section."""

import json
import os
import pathlib
import re
import statistics
import subprocess
import time

from driver.figures import shown, shown_with_spread
from driver.markdown import table
from driver.subjects import SubjectError, TcpHub, allowed_cpus

FIGURES = pathlib.Path(__file__).resolve().parent.parent / "control.json"
SECTION = "## The control plane"
NEXT_SECTIONS = ("## Joins and bystanders", "## All figures")
PATIENCE_SECONDS = 600
REJOINS = 3
ANSWERS = 20
REJOIN_GOAL_SECONDS = 10
ANSWER_GOAL_MS = 50
SIZES = (1_000, 10_000, 100_000)
COMMANDS = ("status", "nodes", "services", "ping")
_REJOIN = re.compile(r"^(\d+) nodes were back ([\d.]+) s after kill -9$", re.MULTILINE)
_UNITS_NS = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}


def run_program(command: list[str], **environment: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_SECONDS, stdin=subprocess.DEVNULL,
                          env=os.environ | environment, check=False)
    if done.returncode != 0:
        raise SubjectError(f"{' '.join(command)} ended with {done.returncode}: {(done.stderr or done.stdout)[-500:]}")
    return done.stdout


def read_rejoin(output: str) -> dict:
    """What tests/stress/rejoin_test.cpp prints."""
    found = _REJOIN.search(output)
    if found is None:
        raise SubjectError("rejoin_test did not say when everybody was back; may it hold 10,000 descriptors here (ulimit -n)?")
    return {"nodes": int(found[1]), "seconds": float(found[2])}


def read_growth(document: dict) -> dict:
    """{operation: {number of names: ns}} of the JSON of bench/hub/control/names_bench.cpp; medians where it was repeated."""
    growth: dict = {}
    for row in document["benchmarks"]:
        name, _, size = row.get("run_name", row["name"]).rpartition("/")
        if row.get("aggregate_name", "median") == "median" and size.isdigit():
            growth.setdefault(name, {})[size] = row["cpu_time"] * _UNITS_NS[row["time_unit"]]
    return growth


def time_answers(build: pathlib.Path) -> dict:
    """{command: milliseconds from start to end of `gimnet`, each time}."""
    gimnet = str(build / "bin" / "gimnet")
    times: dict = {}
    with TcpHub(build, allowed_cpus(), []) as hub:
        url = hub.urls["tcp"]
        named = subprocess.Popen([gimnet, "--hub", url, "recv", "--name", "answering", "--raw"], stdin=subprocess.DEVNULL,
                                 stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            deadline = time.monotonic() + PATIENCE_SECONDS
            while "answering" not in run_program([gimnet, "--hub", url, "nodes"]):
                if time.monotonic() > deadline:
                    raise SubjectError("the node that is to be pinged did not join")
            for command in COMMANDS:
                words = [gimnet, "--hub", url, command] + (["answering", "-c", "1"] if command == "ping" else [])
                times[command] = [_milliseconds(words) for _ in range(ANSWERS)]
        finally:
            named.kill()
            named.wait()
    return times


def _milliseconds(words: list[str]) -> float:
    begin = time.monotonic()
    run_program(words)
    return (time.monotonic() - begin) * 1e3


def measure(build: pathlib.Path) -> dict:
    programs = build.resolve() / "bin"
    rejoin = [read_rejoin(run_program([str(programs / "stress.rejoin_test")], GIMNET_STRESS="full")) for _ in range(REJOINS)]
    names = run_program([str(programs / "bench.hub.control.names_bench"), "--benchmark_format=json", "--benchmark_min_time=0.2"])
    return {"rejoin": rejoin, "growth": read_growth(json.loads(names)), "answers_ms": time_answers(build)}


def _growth_table(growth: dict) -> str:
    def cells(of_size: dict) -> list[str]:
        times = [of_size.get(str(size)) for size in SIZES]
        ratio = times[-1] / times[0] if times[0] and times[-1] else None
        return [shown(value / 1e3 if value is not None else None) for value in times] + [shown(ratio)]

    return table(["operation", *(f"{size:,}: us" for size in SIZES), f"{SIZES[-1]:,} to {SIZES[0]:,}"],
                 [[name, *cells(of_size)] for name, of_size in growth.items()])


def bystanders_lines(rows: list[dict]) -> list[str]:
    """A section; nothing where that was not measured."""
    rows = [row for row in rows if row["scenario"] == "ping_beside_joins" and "p99_us_alone" in row]
    if not rows:
        return []
    names = ("p50_us_alone", "p50_us", "p99_us_alone", "p99_us")
    return [NEXT_SECTIONS[0], "", "Round trips of two nodes, alone and while 1,000 others connect and join (`ping_beside_joins`).", "",
            table(["subject", "p50 alone, us", "p50 beside joins, us", "p99 alone, us", "p99 beside joins, us"],
                  [[row["subject"], *(shown_with_spread(row, name) for name in names)] for row in rows]), ""]


def make_section(figures: dict) -> str:
    """Of docs/performance.md."""
    machine, rejoin = figures["machine"], figures["rejoin"]
    seconds = [each["seconds"] for each in rejoin]
    answers = [[f"gimnet {command}", shown(statistics.median(times)), shown(max(times))]
               for command, times in figures["answers_ms"].items()]
    parts = [SECTION, f"Measured by `./dev perf --control`: {figures['date']}, {machine['processor']}, {machine['cpus_allowed']} processors; "
             f"GIMnet {figures['version']}.",
             f"**Everybody is back** {shown(statistics.median(seconds))} s ({shown(min(seconds))} to {shown(max(seconds))}) after `kill -9` of the "
             f"hub with {rejoin[0]['nodes']:,} nodes, under their ids and names (`tests/stress/rejoin_test.cpp`; goal {REJOIN_GOAL_SECONDS} s).",
             "**Growth** with the number of names, and as many services, on one hub (`bench/hub/control/names_bench.cpp`), CPU time of one "
             "operation; `list_whole`\nand `watch_snapshot/all` are about all of them.", _growth_table(figures["growth"]),
             f"**The tool answers**: from the start of the program to its end, a hub on the same machine, {ANSWERS} times (goal {ANSWER_GOAL_MS} ms).",
             table(["command", "median, ms", "longest, ms"], answers)]
    return "\n\n".join(parts) + "\n"


def section_lines(kept: pathlib.Path | None = None) -> list[str]:
    """The section, from what is kept; nothing where nothing is."""
    kept = kept or FIGURES
    return [make_section(json.loads(kept.read_text()))] if kept.exists() else []


def put_into(page: str, section: str) -> str:
    """docs/performance.md with that section in place of the one that it has, or where it belongs."""
    before, found, behind = page.partition(f"\n{SECTION}\n")
    if found:
        behind = behind[behind.index("\n## ") + 1:]
    else:
        at = min(page.index(f"\n{name}\n") for name in NEXT_SECTIONS if f"\n{name}\n" in page)
        before, behind = page[:at], page[at + 1:]
    return f"{before}\n{section}\n{behind}"
