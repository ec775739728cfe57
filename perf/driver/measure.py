"""Runs cases: each on a fresh subject, subjects in turns, so that a slow minute of the machine hits all of them."""

import json
import pathlib
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from driver.catalogue import make_subject, why_absent
from driver.library import run_pair
from driver.outcome import Outcome
from driver.repetition import find_undecided, to_repeat
from driver.subjects import Subject, SubjectError, allowed_cpus, child_setup
from driver.suite import Case, Plan

# A generator that takes this much longer than its measurement hangs.
EXTRA_SECONDS = 35
# Of the time for runs that are made again, one group takes at most this much of what is left.
GROUP_SHARE = 0.2


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
    runs_max: int = 0  # of those whose runs lie far apart or decide nothing; not above `runs`: none of them is made again
    extra_seconds: float = 0  # what is left for such runs

    def length_of(self, subject: str, case: Case) -> float:
        """Of one measurement, in seconds."""
        if self.seconds_of is not None:
            return self.seconds_of(subject, case)
        return self.seconds * case.spec.seconds_factor


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def run_once(subject: Subject, case: Case, settings: Settings) -> dict[str, float]:
    if case.spec.roles is not None:
        with subject:
            return run_pair(subject, case, settings)
    cpus = allowed_cpus()
    seconds = settings.length_of(subject.name, case)
    command = [str(settings.build / "bin" / "load_generator"), "--wire", subject.wire, "--scenario", case.scenario,
               "--size", str(case.size), "--seconds", str(seconds),
               "--patience", str(settings.patience_seconds)]
    if settings.clients is not None:
        command += ["--clients", str(settings.clients)]
    with subject:
        command += ["--connect", subject.urls[case.transport], "--process", str(subject.pid)]
        if case.transport in subject.publish_urls:
            command += ["--publish-to", subject.publish_urls[case.transport]]
        limit = 3 * seconds + 5 * settings.patience_seconds + EXTRA_SECONDS
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=limit, stdin=subprocess.DEVNULL,
                                  preexec_fn=child_setup([cpus[0] if case.spec.one_cpu else cpus[-1]]))
        except subprocess.TimeoutExpired:
            raise SubjectError(f"{subject.name}: no result within {limit:.0f} s") from None
        subject.check_alive()
        if done.returncode != 0:
            raise SubjectError(f"{subject.name}: {done.stderr.strip() or f'the generator ended with {done.returncode}'}")
        return json.loads(done.stdout)


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
        say(f"  {outcome.subject}: {outcome.case} ({number + 1}/{max(settings.runs, number + 1)})")
        try:
            outcome.add(number, run_patiently(outcome, settings))
        except SubjectError as error:
            outcome.error = str(error)
            say(f"error: {outcome.case}: {outcome.error}")


def run_group(outcomes: list[Outcome], settings: Settings) -> None:
    for number in range(settings.runs):
        run_round(outcomes, number, settings)
    repeat(outcomes, settings)


def repeat(outcomes: list[Outcome], settings: Settings) -> None:
    """More runs of what lies far apart or decides nothing, as long as there is time for that: no group takes more than its share
    of it. What decides nothing is looked up once: to stop as soon as something is decided would be to choose the answer."""
    left_for_others = settings.extra_seconds * (1 - GROUP_SHARE)
    undecided = find_undecided(outcomes) if settings.runs < settings.runs_max else []
    for number in range(settings.runs, settings.runs_max):
        again = to_repeat(outcomes, undecided)
        if not again or settings.extra_seconds <= left_for_others:
            return
        begin = time.monotonic()
        run_round(again, number, settings)
        settings.extra_seconds -= time.monotonic() - begin


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
