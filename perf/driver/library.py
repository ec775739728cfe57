"""Two programs that talk through a hub by means of its own library (perf/library): how they are started and measured."""

import json
import os
import select
import subprocess
import time

from driver.subjects import READY_SECONDS, Subject, SubjectError, allowed_cpus, child_setup
from driver.suite import Case

CLIENTS = {"tcphub": "library_client_nif", "nats": "library_client_nats", "mosquitto": "library_client_mosquitto"}
# Beyond its measurement a program that takes longer hangs.
EXTRA_SECONDS = 35
LEDGER = ("ledger_gap", "dropped_frames", "queued_frames")


def await_ready(partner: subprocess.Popen) -> None:
    """The partner says so when its messages would reach it."""
    deadline = time.monotonic() + READY_SECONDS
    line = b""
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([partner.stdout], [], [], max(0.0, deadline - time.monotonic()))
        piece = os.read(partner.stdout.fileno(), 100) if ready else b""
        if not piece:
            raise SubjectError("the answering program was not ready in time" if not ready else ended(partner))
        line += piece


def ended(partner: subprocess.Popen) -> str:
    partner.wait(READY_SECONDS)
    return f"the answering program ended with {partner.returncode}: {partner.stderr.read(2000).decode(errors='replace').strip()}"


def run_pair(subject: Subject, case: Case, settings) -> dict[str, float]:
    """What the asking program found. Raises SubjectError."""
    answering, asking = case.spec.roles
    cpus = allowed_cpus()[:1] if case.spec.one_cpu else allowed_cpus()
    seconds = settings.length_of(subject.name, case)
    command = [str(settings.build / "bin" / CLIENTS[subject.name]), "--connect", subject.urls[case.transport],
               "--size", str(case.size), "--seconds", str(seconds),
               "--patience", str(settings.patience_seconds), "--hub", str(subject.pid)]
    partner = subprocess.Popen([*command, "--role", answering], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, preexec_fn=child_setup(cpus))
    try:
        await_ready(partner)
        limit = 3 * seconds + 5 * settings.patience_seconds + EXTRA_SECONDS
        try:
            done = subprocess.run([*command, "--role", asking, "--partner", str(partner.pid)], capture_output=True,
                                  text=True, timeout=limit, stdin=subprocess.DEVNULL, preexec_fn=child_setup(cpus))
        except subprocess.TimeoutExpired:
            raise SubjectError(f"{subject.name}: no result within {limit:.0f} s") from None
        subject.check_alive()
        if partner.poll() is not None:
            raise SubjectError(f"{subject.name}: {ended(partner)}")
        if done.returncode != 0:
            raise SubjectError(f"{subject.name}: {done.stderr.strip() or f'the client ended with {done.returncode}'}")
        findings = json.loads(done.stdout)
    finally:
        partner.kill()
        partner.communicate()
    return findings | ask_for_ledger(subject, case, settings)


def ask_for_ledger(subject: Subject, case: Case, settings) -> dict[str, float]:
    """What a hub of ours accounts for, now that both programs are gone; nothing of others, which keep no account."""
    if subject.wire != "gimnet":
        return {}
    # The scenario in which nobody is connected: it only asks at its end.
    command = [str(settings.build / "bin" / "load_generator"), "--wire", subject.wire, "--connect", subject.urls[case.transport],
               "--process", str(subject.pid), "--scenario", "idle_alone", "--seconds", "0.01"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=EXTRA_SECONDS, stdin=subprocess.DEVNULL,
                              preexec_fn=child_setup(allowed_cpus()))
    except subprocess.TimeoutExpired:
        raise SubjectError(f"{subject.name}: did not tell its ledger within {EXTRA_SECONDS} s") from None
    if done.returncode != 0:
        raise SubjectError(f"{subject.name}: did not tell its ledger: {done.stderr.strip()}")
    return {name: value for name, value in json.loads(done.stdout).items() if name in LEDGER}
