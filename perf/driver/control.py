"""What the control plane takes: how long until everybody is back after kill -9, how the work on names and services grows with
their number, how soon the tool answers. `./dev perf --control` measures it and keeps it in docs/performance/control.json."""

import json
import os
import pathlib
import re
import statistics
import subprocess
import textwrap
import time

from driver.rows import shown
from driver.subjects import SubjectError, TcpHub, allowed_cpus

FIGURES = pathlib.Path(__file__).resolve().parents[2] / "docs" / "performance" / "control.json"
PATIENCE_SECONDS = 600
REJOINS = 3
ANSWERS = 20
REJOIN_GOAL_SECONDS = 10
ANSWER_GOAL_MS = 50
SIZES = ("1000", "100000")  # names on the hub
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


def describe(figures: dict) -> str:
    """One paragraph for docs/performance.md, of what is kept."""
    machine, rejoin = figures["machine"], figures["rejoin"]
    seconds = [each["seconds"] for each in rejoin]
    answers = [each for times in figures["answers_ms"].values() for each in times]
    growth = [f"{name} {shown(times[SIZES[0]] / 1e3)} to {shown(times[SIZES[1]] / 1e3)}" for name, times in figures["growth"].items()
              if all(size in times for size in SIZES)]
    text = (f"{figures['date']}, {machine['processor']}, {machine['cpus_allowed']} processors, GIMnet {figures['version']}. After `kill -9` of the hub "
            f"all {rejoin[0]['nodes']:,} nodes are back in {shown(statistics.median(seconds))} s ({shown(min(seconds))} to {shown(max(seconds))}; goal "
            f"{REJOIN_GOAL_SECONDS} s). A command of `gimnet` takes {shown(statistics.median(answers))} ms from start to end, at most "
            f"{shown(max(answers))} (goal {ANSWER_GOAL_MS} ms). CPU time of one operation in us, with 1,000 and with 100,000 names on the hub: "
            f"{', '.join(growth)}.")
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)
