"""Runs cases: each on a fresh subject, subjects in turns, so that a slow minute of the machine hits all of them."""

import json
import pathlib
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

from driver.rows import Outcome
from driver.subjects import (CLIENTS, Subject, SubjectError, allowed_cpus, child_setup, make_subject, read_line, why_absent)
from driver.suite import RIVALS, Case, Plan

# A generator that takes this much longer than its measurement hangs.
EXTRA_SECONDS = 35
LEDGER = ("ledger_gap", "dropped_frames", "queued_frames")


@dataclass
class Settings:
    build: pathlib.Path
    seconds: float = 1.0  # of each measurement, times the scenario's factor
    seconds_of: Callable[[str, Case], float] | None = None  # of one subject and case, if not `seconds`
    runs: int = 3
    clients: int | None = None  # of idle_10000, connect_10000, join_under_load and ping_beside_joins
    hub_arguments: list[str] = field(default_factory=list)
    tries_max: int = 2  # of each run
    patience_seconds: float = 2.0  # a message that takes longer is lost

    def length_of(self, subject: str, case: Case) -> float:
        """Of one measurement, in seconds."""
        if self.seconds_of is not None:
            return self.seconds_of(subject, case)
        return self.seconds * case.spec.seconds_factor


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def ended(partner: subprocess.Popen) -> str:
    return f"the answering program ended with {partner.returncode}: {partner.stderr.read(2000).decode(errors='replace').strip()}"


def run_client(subject: Subject, command: list[str], cpus: list[int], limit: float) -> dict[str, float]:
    """What a measuring program found. Raises SubjectError."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, stdin=subprocess.DEVNULL,
                              preexec_fn=child_setup(cpus))
    except subprocess.TimeoutExpired:
        raise SubjectError(f"{subject.name}: no result within {limit:.0f} s") from None
    subject.check_alive()
    if done.returncode != 0:
        raise SubjectError(f"{subject.name}: {done.stderr.strip() or f'the measuring program ended with {done.returncode}'}")
    return json.loads(done.stdout)


def run_pair(subject: Subject, case: Case, settings: Settings, seconds: float, limit: float) -> dict[str, float]:
    """What the asking program found, and the hub's ledger. Raises SubjectError."""
    answering, asking = case.spec.roles
    cpus = allowed_cpus()[:1] if case.spec.one_cpu else allowed_cpus()
    command = [str(settings.build / "bin" / CLIENTS[subject.name]), "--connect", subject.urls[case.transport],
               "--size", str(case.size), "--seconds", str(seconds),
               "--patience", str(settings.patience_seconds), "--hub", str(subject.pid)]
    partner = subprocess.Popen([*command, "--role", answering], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, preexec_fn=child_setup(cpus))
    try:
        # It says so when its partner's messages would reach it.
        if read_line(partner) is None:
            raise SubjectError("the answering program was not ready in time" if partner.poll() is None else ended(partner))
        findings = run_client(subject, [*command, "--role", asking, "--partner", str(partner.pid)], cpus, limit)
        if partner.poll() is not None:
            raise SubjectError(f"{subject.name}: {ended(partner)}")
    finally:
        partner.kill()
        partner.communicate()
    return findings | ask_for_ledger(subject, case, settings)


def ask_for_ledger(subject: Subject, case: Case, settings: Settings) -> dict[str, float]:
    """The account of a hub of ours, now that both programs are gone; nothing of others, which keep none."""
    if subject.name in RIVALS:
        return {}
    # The scenario in which nobody is connected: it only asks at its end.
    command = [str(settings.build / "bin" / "load_generator"), "--connect", subject.urls[case.transport],
               "--process", str(subject.pid), "--scenario", "idle_alone", "--seconds", "0.01"]
    findings = run_client(subject, command, allowed_cpus(), EXTRA_SECONDS)
    return {name: value for name, value in findings.items() if name in LEDGER}


def run_once(subject: Subject, case: Case, settings: Settings) -> dict[str, float]:
    seconds = settings.length_of(subject.name, case)
    limit = 3 * seconds + 5 * settings.patience_seconds + EXTRA_SECONDS
    with subject:
        if case.spec.roles is not None:
            return run_pair(subject, case, settings, seconds, limit)
        command = [str(settings.build / "bin" / "load_generator"), "--scenario", case.scenario,
                   "--size", str(case.size), "--seconds", str(seconds), "--patience", str(settings.patience_seconds),
                   "--connect", subject.urls[case.transport], "--process", str(subject.pid)]
        if settings.clients is not None:
            command += ["--clients", str(settings.clients)]
        if subject.name == "null":
            command.append("--null")
        return run_client(subject, command, [allowed_cpus()[0 if case.spec.one_cpu else -1]], limit)


def run_with_tries(make: Callable[[], Subject], case: Case, settings: Settings) -> dict[str, float]:
    """A second try where the first failed, since a machine that stands still for seconds says nothing of a subject."""
    for tries_left in range(settings.tries_max - 1, -1, -1):
        try:
            return run_once(make(), case, settings)
        except SubjectError as error:
            if tries_left == 0:
                raise
            say(f"warning: {case}: {error}; once more")
    raise AssertionError("not reached")


def run_patiently(outcome: Outcome, settings: Settings) -> dict[str, float]:
    return run_with_tries(lambda: make_subject(outcome.subject, outcome.case, settings.build, settings.hub_arguments), outcome.case, settings)


def run_round(members: list[Outcome], number: int, settings: Settings) -> None:
    """One run each. Every second round goes the other way, so that nobody profits from always being behind somebody."""
    for outcome in members if number % 2 == 0 else reversed(members):
        if outcome.error is not None:
            continue
        say(f"  {outcome.subject}: {outcome.case} ({number + 1}/{settings.runs})")
        try:
            outcome.add(number, run_patiently(outcome, settings))
        except SubjectError as error:
            outcome.error = str(error)
            say(f"error: {outcome.case}: {outcome.error}")


def run_group(outcomes: list[Outcome], settings: Settings) -> None:
    for number in range(settings.runs):
        run_round(outcomes, number, settings)


def make_group(members: list[tuple[Case, tuple[str, ...]]], build: pathlib.Path) -> list[Outcome]:
    """Case by case, each behind the null relay that it is compared with, if that is asked for and was not there before."""
    group: list[Outcome] = []
    for case, subjects in members:
        null = Outcome("null", case.baseline or case)
        if "null" in subjects and not any(each.subject == "null" and each.case == null.case for each in group):
            group.append(null)
        group += [Outcome(name, case) for name in subjects if name != "null"]
    for outcome in group:
        outcome.error = why_absent(outcome.subject, outcome.case, build)
        outcome.is_absent = outcome.error is not None
    return group


def run_cases(plan: Plan, settings: Settings) -> list[Outcome]:
    """Cases that are compared with each other are one group, whose subjects take turns: null relay, hub, others, ..."""
    groups: dict[Case, list[tuple[Case, tuple[str, ...]]]] = {}
    for case, subjects in plan.items():
        groups.setdefault(case.group, []).append((case, subjects))
    outcomes = []
    for members in groups.values():
        group = make_group(members, settings.build)
        run_group(group, settings)
        outcomes += group
    return outcomes
