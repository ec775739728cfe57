#!/usr/bin/env python3
"""Measures the shipped hub against the null relay and against other hubs. `./dev perf` calls it after building; docs/performance.md explains
what is measured and how. The table and all progress go to standard error; --json prints one document on standard output."""

import argparse
import dataclasses
import datetime
import functools
import itertools
import json
import os
import pathlib
import platform
import re
import signal
import subprocess
import sys
import types
from collections.abc import Callable

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import report  # noqa: E402
from driver import against, control, instructions, network, python, subjects, suite, usage  # noqa: E402
from driver.measure import Outcome, Settings, run_cases, say  # noqa: E402
from driver.rows import absence_lines, faults_of, make_absences, make_rows, text_table  # noqa: E402
from driver.subjects import SubjectError, allowed_cpus  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent
QUICK_SECONDS = 0.4
WHOLE_SECONDS = 0.5
RUNS = 3
SMOKE_CLIENTS = 200  # of scenarios with 10,000 or 1,000: in a smoke run it is not counted how long they take
SMOKE_PATIENCE_SECONDS = 30
PARTS = {"control": control, "network": network, "python": python}  # modes with a place on the page of their own
SKIPPED = 77  # what ctest takes for a test that was left out


def parse_arguments(given: list[str] | None = None) -> argparse.Namespace:
    # ./dev looks for whole words in the same arguments.
    parser = argparse.ArgumentParser(prog="./dev perf", description=__doc__, allow_abbrev=False)
    parser.add_argument("--quick", action="store_true", help="the scenarios that decide, in a few minutes")
    parser.add_argument("--smoke", action="store_true", help="every scenario for a second, with 200 clients for 10,000: is anything lost? times mean nothing")
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    parser.add_argument("--report", action="store_true", help="fill docs/performance.md, its plots and full tables, of the whole suite")
    parser.add_argument("--subjects", "--only", nargs="+", action="extend", choices=subjects.SUBJECTS, default=[],
                        metavar="NAME", help=", ".join(subjects.SUBJECTS) + "; default: all; the null relay is always among them")
    parser.add_argument("--against", metavar="REV", help="build that version too, and say which is faster; --runs are pairs")
    parser.add_argument("--instructions", nargs="?", const="", metavar="SCRIPT",
                        help="instructions per frame against the budget; of one script: where they go")
    parser.add_argument("--update", action="store_true", help="with --instructions: make what is counted the budget")
    parser.add_argument("--control", action="store_true",
                        help="what the control plane takes, into docs/performance/control.json; with --report into docs/performance.md, too")
    parser.add_argument("--network", action="store_true", help="what a network of hubs takes, into docs/performance/network.json; --report as there")
    parser.add_argument("--python", action="store_true",
                        help="Python programs beside those of paho-mqtt and pyzmq, into docs/performance/python.json; --report as above")
    parser.add_argument("--packages", action="store_true", help="only print the Debian packages that the run needs")
    parser.add_argument("--scenario", nargs="+", action="extend", choices=list(suite.SCENARIOS), default=[],
                        metavar="NAME", help=", ".join(suite.SCENARIOS))
    parser.add_argument("--size", nargs="+", action="extend", type=usage.payload_bytes, default=[], metavar="BYTES",
                        help="16 to 1,048,576; others than those of the whole run, too")
    parser.add_argument("--transport", nargs="+", action="extend", choices=("tcp", "unix"), default=[])
    parser.add_argument("--seconds", type=usage.seconds, help="length of each measurement, 0.01 to 450; some scenarios take several times that")
    parser.add_argument("--runs", type=usage.positive_whole, help="measurements of which the median is taken (3; 9 decide more)")
    parser.add_argument("--build-dir", type=pathlib.Path, default=ROOT / "build" / "release")
    parser.add_argument("--hub-argument", action="append", default=[], metavar="ARGUMENT",
                        help="one more word for the hub's command line, and another for the value of an option: "
                             "--hub-argument=--shards --hub-argument=2")
    arguments = parser.parse_args(given)
    if (wrong := usage.find_wrong(arguments, parser.get_default) or find_impossible(arguments)) is not None:
        parser.error(wrong)
    return arguments


def find_impossible(arguments: argparse.Namespace) -> str | None:
    """Why what is asked for cannot be had, as far as that is known before anything is installed or built."""
    mode = usage.mode_of(arguments)
    try:
        if mode == "--instructions" and arguments.instructions:
            instructions.require_script(arguments.instructions, instructions.known_scripts())
        if mode == "--against":
            against.require_comparable(ROOT, arguments.against, cases_against(arguments), arguments.runs)
        return None if mode is not None or choose_plan(arguments) else "these scenarios are not measured over that transport"
    except (instructions.CountingError, against.BuildError) as error:
        return str(error)


def choose_plan(arguments: argparse.Namespace) -> suite.Plan:
    subjects = chosen_subjects(arguments)
    if arguments.scenario or arguments.size or arguments.transport:
        return suite.chosen_plan(arguments.scenario, arguments.size, arguments.transport, subjects)
    make = suite.smoke_plan if arguments.smoke else suite.quick_plan if arguments.quick else suite.whole_plan
    return make(subjects)


def chosen_subjects(arguments: argparse.Namespace) -> tuple[str, ...]:
    """In the order of the catalogue, the null relay always first: everything is compared with it."""
    return tuple(name for name in subjects.SUBJECTS if not arguments.subjects or name in ("null", *arguments.subjects))


def needed_packages(arguments: argparse.Namespace) -> list[str]:
    if arguments.instructions is not None:
        return ["valgrind"]
    if arguments.against is not None or arguments.control or arguments.network:
        return []
    if arguments.python:
        return python.PACKAGES
    packages = []
    for name in chosen_subjects(arguments):
        if name in suite.RIVALS and any(name in wanted for wanted in choose_plan(arguments).values()):
            packages += [subjects.RIVAL_CLASSES[name].package, subjects.LIBRARY_PACKAGES[name]]
    return packages + (["python3-matplotlib"] if arguments.report else [])


def lengths(arguments: argparse.Namespace) -> Callable[[str, suite.Case], float] | None:
    """How long each measurement takes, where that is not --seconds or QUICK_SECONDS times the scenario's factor."""
    if arguments.seconds or arguments.quick or arguments.against is not None:
        return None
    return suite.smoke_seconds if arguments.smoke else functools.partial(suite.whole_seconds, WHOLE_SECONDS)


def make_settings(arguments: argparse.Namespace) -> Settings:
    usual = suite.SMOKE_SECONDS if arguments.smoke else QUICK_SECONDS if arguments.quick else WHOLE_SECONDS
    return Settings(build=arguments.build_dir, seconds=arguments.seconds or usual,
                    seconds_of=lengths(arguments),
                    runs=arguments.runs or (1 if arguments.smoke else RUNS),
                    clients=SMOKE_CLIENTS if arguments.smoke else None, hub_arguments=arguments.hub_argument,
                    tries_max=1 if arguments.smoke else 2,
                    patience_seconds=SMOKE_PATIENCE_SECONDS if arguments.smoke else Settings.patience_seconds)


def processor_name() -> str:
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def describe_machine() -> dict:
    return {"processor": processor_name(), "cpus": os.cpu_count(), "cpus_allowed": len(allowed_cpus()),
            "kernel": platform.release(), "system": platform.freedesktop_os_release().get("PRETTY_NAME", "")}


def program_version() -> str:
    """The version of the project and, where this is a git work tree, the commit."""
    found = re.search(r"project\(gimnet VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())
    version = found.group(1) if found else "unknown"
    try:
        commit = subprocess.run(["git", "-C", str(ROOT), "describe", "--always", "--dirty"], capture_output=True,
                                text=True, timeout=10)
        return f"{version} ({commit.stdout.strip()})" if commit.returncode == 0 else version
    except (OSError, subprocess.TimeoutExpired):
        return version


def judge(outcomes: list[Outcome], rows: list[dict], is_smoke: bool) -> int:
    """The exit status: nothing of ours failed, nothing arrived wrong, ledgers are exact; in a smoke run nothing was lost
    either. What other hubs do is said, but is not our failure."""
    status = 0
    for outcome in outcomes:
        if outcome.error is not None and not outcome.is_absent:
            is_ours = outcome.subject not in subjects.RIVAL_CLASSES
            say(f"{'error' if is_ours else 'warning'}: {outcome.subject}, {outcome.case}: {outcome.error}")
            status = 1 if is_ours else status
    for row in rows:
        is_ours = row["subject"] not in subjects.RIVAL_CLASSES
        where = f"{row['subject']}, {row['scenario']} {row['size']} B {row['transport']}"
        for fault in faults_of(where, row, is_ours, is_smoke):
            say(str(fault))
            status = 1 if fault.is_error else status
    return status


def measure(arguments: argparse.Namespace) -> int:
    settings = make_settings(arguments)
    for program in ("tcphub", "null_relay", "load_generator"):
        if not (settings.build / "bin" / program).exists():
            say(f"error: {settings.build}/bin/{program} is not there: build it first (./dev build)")
            return 1
    if len(allowed_cpus()) < 2:
        say("warning: one processor only: the generator takes the subject's time")
    outcomes = run_cases(choose_plan(arguments), settings)
    rows, absences = make_rows(outcomes), make_absences(outcomes)
    say(text_table(rows))
    for line in absence_lines(absences):
        say(f"no row: {line}")
    document = {"results": rows, "absent": absences, "machine": describe_machine(), "version": program_version(),
                "versions": subjects.rival_versions(list(chosen_subjects(arguments))),
                "date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(),
                "seconds": settings.seconds, "longer": [[*dataclasses.astuple(case), least, subjects] for case, (least, subjects) in
                                                                suite.WHOLE_SECONDS.items() if settings.seconds_of is not None and not arguments.smoke],
                "runs": settings.runs, "hub_arguments": settings.hub_arguments}
    if arguments.json:
        print(json.dumps(document, indent=1))
    if arguments.report:
        report.write_report(document, report.PAGE)
    return judge(outcomes, rows, arguments.smoke)


def count_instructions(arguments: argparse.Namespace) -> int:
    """The exit status: 1 where a script takes more than its budget allows or could not be counted, 77 (skipped) where no machine
    like this could."""
    program = arguments.build_dir.resolve() / "bin" / "instruction_scripts"
    try:
        made_by, scripts = instructions.describe(program)
        budget = instructions.load_budget()
        if arguments.instructions:
            instructions.require_script(arguments.instructions, scripts)
            per_frame, costs = instructions.count(program, arguments.instructions)
            for function, cost in itertools.islice(costs.items(), 40):
                say(f"{cost / per_frame:7.1%} {cost:9.1f}  {function}")
            return 0
        if not arguments.update:
            instructions.require_comparable(made_by, budget)
        verdicts = instructions.measure(program, scripts, budget)
    except instructions.NotCountable as error:
        say(f"SKIPPED: {error}")
        return SKIPPED
    except instructions.CountingError as error:
        say(f"error: {error}")
        return 1
    say("\n".join(["instructions per frame:", *map(str, verdicts)]))
    if any(verdict.is_above_base for verdict in verdicts):
        say("all changes together take too much more than perf/instructions/base.json: make something cheaper,\n"
            "or name the script there, with what it is allowed and why")
        return 1
    if arguments.update:
        instructions.update_budget(made_by, verdicts)
        return 0
    if any(verdict.is_slower for verdict in verdicts):
        say("more than the budget allows: make it cheaper, or say in the change why it is worth it and\n"
            "    ./dev perf --instructions --update")
        return 1
    return 0


def measure_part(arguments: argparse.Namespace, part: types.ModuleType) -> int:
    """A part has figures and a place on the page of its own."""
    try:
        figures = part.measure(arguments.build_dir)
    except (SubjectError, OSError, subprocess.TimeoutExpired) as error:
        say(f"error: {error}")
        return 1
    figures |= {"date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(), "machine": describe_machine(),
                "version": program_version()}
    part.FIGURES.write_text(json.dumps(figures, indent=1) + "\n")
    text = part.describe(figures)
    say(text)
    if arguments.report:
        report.PAGE.write_text(report.fill(report.PAGE.read_text(), part.FIGURES.stem, text))
    return 0


def cases_against(arguments: argparse.Namespace) -> list[suite.Case]:
    if arguments.scenario or arguments.size or arguments.transport:
        return list(suite.chosen_plan(arguments.scenario, arguments.size, arguments.transport, ()))
    return list(against.CASES)


def compare_versions(arguments: argparse.Namespace) -> int:
    """The exit status: 1 where this version is slower, or something of it failed."""
    settings = make_settings(arguments)
    settings.seconds = arguments.seconds or against.PAIR_SECONDS
    try:
        document = against.compare_versions(ROOT, arguments.against, cases_against(arguments), arguments.runs, settings)
    except against.BuildError as error:
        say(f"error: {error}")
        return 1
    if arguments.json:
        print(json.dumps(document, indent=1))
    return 0 if document["is_good"] else 1


def main() -> int:
    arguments = parse_arguments()
    if arguments.packages:
        print(" ".join(needed_packages(arguments)))
        return 0
    if arguments.instructions is not None:
        return count_instructions(arguments)
    for mode, part in PARTS.items():
        if getattr(arguments, mode):
            return measure_part(arguments, part)
    if arguments.against is not None:
        return compare_versions(arguments)
    return measure(arguments)


if __name__ == "__main__":
    # So that `with` blocks end their children when this program is told to stop.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
