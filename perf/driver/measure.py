"""Runs cases: each on a fresh subject, subjects in turns, so that a slow minute of the machine hits all of them."""

import json
import pathlib
import subprocess
import sys
from dataclasses import dataclass, field

from driver.subjects import NullRelay, Subject, SubjectError, TcpHub, allowed_cpus, child_setup
from driver.suite import Case

# A generator that takes this much longer than its measurement hangs.
EXTRA_SECONDS = 45


@dataclass
class Settings:
    build: pathlib.Path
    seconds: float = 1.0
    runs: int = 3
    clients: int | None = None  # of idle_10000 and connect_10000
    hub_arguments: list[str] = field(default_factory=list)
    null_scenarios: frozenset[str] | None = None  # with which the null relay is run; None: with all


@dataclass
class Outcome:
    """What the runs of one case on one subject found, or why there is nothing."""

    subject: str
    case: Case
    findings: list[dict[str, float]] = field(default_factory=list)
    error: str | None = None


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def run_once(subject: Subject, case: Case, settings: Settings) -> dict[str, float]:
    cpus = allowed_cpus()
    command = [str(settings.build / "bin" / "load_generator"), "--wire", subject.wire, "--scenario", case.scenario,
               "--size", str(case.size), "--seconds", str(settings.seconds)]
    if settings.clients is not None:
        command += ["--clients", str(settings.clients)]
    with subject:
        command += ["--connect", subject.urls[case.transport], "--process", str(subject.pid)]
        limit = 3 * settings.seconds + EXTRA_SECONDS
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=limit, stdin=subprocess.DEVNULL,
                                  preexec_fn=child_setup(cpus[0] if case.spec.one_cpu else cpus[-1]))
        except subprocess.TimeoutExpired:
            raise SubjectError(f"{subject.name}: no result within {limit:.0f} s") from None
        subject.check_alive()
        if done.returncode != 0:
            raise SubjectError(f"{subject.name}: {done.stderr.strip() or f'the generator ended with {done.returncode}'}")
        return json.loads(done.stdout)


def make_subject(name: str, case: Case, settings: Settings) -> Subject:
    cpu = allowed_cpus()[0]
    if name == "null":
        return NullRelay(settings.build, cpu, case.spec.relay_mode)
    return TcpHub(settings.build, cpu, settings.hub_arguments)


def run_group(outcomes: list[Outcome], settings: Settings) -> None:
    for run in range(settings.runs):
        for outcome in outcomes:
            if outcome.error is not None:
                continue
            say(f"  {outcome.subject}: {outcome.case} ({run + 1}/{settings.runs})")
            try:
                outcome.findings.append(run_once(make_subject(outcome.subject, outcome.case, settings), outcome.case,
                                                 settings))
            except SubjectError as error:
                outcome.error = f"{outcome.case}: {error}"
                say(f"error: {outcome.error}")


def run_cases(cases: list[Case], settings: Settings) -> list[Outcome]:
    """Cases with the same baseline are one group: null relay, hub, null relay, hub, ..."""
    groups: dict[Case, list[Case]] = {}
    for case in dict.fromkeys(cases):
        groups.setdefault(case.baseline or case, []).append(case)
    outcomes = []
    for key, members in groups.items():
        is_compared = members[0].baseline is not None
        if settings.null_scenarios is not None:
            is_compared = is_compared and key.scenario in settings.null_scenarios
        group = [Outcome("null", key)] if is_compared else []
        group += [Outcome("tcphub", case) for case in members]
        run_group(group, settings)
        outcomes += group
    return outcomes
