"""All subjects by name: which there are, which can be measured here and in which cases, and how each is made."""

import pathlib
import re
import subprocess

from driver.library import CLIENTS
from driver.rivals import RIVALS, Rival, find_program
from driver.subjects import NullRelay, Subject, TcpHub, allowed_cpus
from driver.suite import WITH_LIBRARY, Case, Plan

HUBS = {"tcphub": [], "tcphub_2_shards": ["--shards", "2"], "tcphub_spinning": ["--spin"]}
RIVAL_CLASSES = {rival.name: rival for rival in RIVALS}
SUBJECTS = ("null", *HUBS, *RIVAL_CLASSES)
PACKAGES = {"nats": "nats-server", "mosquitto": "mosquitto", "redis": "redis-server", "zeromq": "libzmq3-dev"}
LIBRARY_PACKAGES = {"nats": "libnats-dev", "mosquitto": "libmosquitto-dev"}
NOT_OF_TOPICS = {"list_100": "it has no lists of recipients",
                 "broadcast_100": "it has no broadcast; a topic to which all subscribe is fan_out_100"}


def why_never(name: str, case: Case) -> str | None:
    """Why there can be no row of this subject for this case, whatever is built or installed."""
    if name == "null" and case.baseline is None:
        return "a relay without queues says nothing here"
    if name not in RIVAL_CLASSES:
        return None
    if case.transport not in RIVAL_CLASSES[name].transports:
        return "it has no Unix socket"
    return NOT_OF_TOPICS.get(case.scenario)


def why_absent(name: str, case: Case, build: pathlib.Path) -> str | None:
    """Why there will be no row of this subject for this case; None: there will be one."""
    if (never := why_never(name, case)) is not None or name not in RIVAL_CLASSES:
        return never
    if case.spec.roles is not None and not (build / "bin" / CLIENTS[name]).exists():
        return f"{CLIENTS[name]} was not built: no library (package {LIBRARY_PACKAGES[name]})"
    return RIVAL_CLASSES[name].why_absent(build)


def why_nothing(plan: Plan, wanted: list[str]) -> str | None:
    """Why none of the wanted subjects has a row, whatever is built or installed; None: one has."""
    if not plan:
        return "these scenarios are not measured over that transport"
    reasons = {}
    for name in wanted:
        cases = [case for case, subjects in plan.items() if name in subjects]
        found = {why_never(name, case) for case in cases} or {f"libraries are measured with {', '.join(WITH_LIBRARY)} only"}
        if None in found:
            return None
        reasons[name] = " and ".join(sorted(found))
    return "; ".join(f"{name}: {reason}" for name, reason in reasons.items())


def make_subject(name: str, case: Case, build: pathlib.Path, hub_arguments: list[str]) -> Subject:
    cpus = allowed_cpus()
    if case.spec.roles is not None and not case.spec.one_cpu:
        # Programs and hub run where the system puts them.
        return RIVAL_CLASSES[name](build, cpus) if name in RIVAL_CLASSES else TcpHub(build, cpus, hub_arguments, name)
    if name == "null":
        return NullRelay(build, cpus[0], case.spec.relay_mode)
    if name in RIVAL_CLASSES:
        return RIVAL_CLASSES[name](build, cpus[:1])
    # A second shard gets a processor of its own where the generator leaves one.
    own = cpus[: max(1, min(2, len(cpus) - 1))] if name == "tcphub_2_shards" else cpus[:1]
    return TcpHub(build, own, [*HUBS[name], *hub_arguments], name)


def _version_of(command: list[str]) -> str | None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, stdin=subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired):
        return None
    found = re.search(r"\d+\.\d+(\.\d+)*", done.stdout + done.stderr)
    return found.group(0) if found else None


def _package_version(package: str) -> str | None:
    return _version_of(["dpkg-query", "-W", "-f=${Version}", package])


def rival_versions(names: list[str]) -> dict[str, str]:
    """What of the other hubs is installed, and its version."""
    versions = {}
    for name in names:
        if name in LIBRARY_PACKAGES:
            library = LIBRARY_PACKAGES[name].removesuffix("-dev")
            if (version := _package_version(LIBRARY_PACKAGES[name])) is not None:
                versions[library] = version
        if name == "zeromq":
            version = _package_version("libzmq5")
        else:
            rival = RIVAL_CLASSES.get(name)
            program = find_program(rival.program) if rival is not None and issubclass(rival, Rival) else None
            version = _version_of([program, "-h" if name == "mosquitto" else "--version"]) if program else None
        if version is not None:
            versions[name] = version
    return versions
