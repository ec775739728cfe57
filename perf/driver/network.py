"""What a network of hubs takes: CPU and round trips over several hubs beside one, how soon 16 hubs know each other, how soon frames
go another way. `./dev perf --network` measures it and keeps it in docs/performance/network.json."""

import contextlib
import itertools
import json
import pathlib
import random
import signal
import statistics
import subprocess
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterator

from driver.control import run_program
from driver.rows import shown
from driver.subjects import CLIENTS, SubjectError, TcpHub, allowed_cpus, child_setup, read_line

FIGURES = pathlib.Path(__file__).resolve().parents[2] / "docs" / "performance" / "network.json"
RUNS = 5
SECONDS = 1.0
SIZES = (16, 65536)
HUBS = 16
PATIENCE_SECONDS = 30
LANES = ("real_time", "normal", "bulk", "background")
# Nodes that stand still are waited for, and 64 KiB fill their lanes.
PATIENT = [word for lane in range(4) for word in ("--limit", f"lane{lane}_bytes=65536")] + ["--limit", "block_ms=600000", "--limit", "silent_ms=600000"]
# At least: rates. At most: the others.
GOALS = {"cut_off_rate": 0.95, "cut_off_round_trip": 1 / 0.95, "beside_rate": 0.95, "beside_ping_p99": 1.5, "cpu_16": 3.05, "cpu_65536": 3.05, "round_trip": 1.8, "converged_s": 2.0, "closed_ms": 500, "silent_ms": 1500}


class Network(contextlib.ExitStack):
    """Linked hubs on one processor, for `with`."""

    def __init__(self, build: pathlib.Path):
        super().__init__()
        self._build, self.hubs = build, []

    def add(self, *others: str, limits: list[str] = []) -> TcpHub:
        """A hub that links to these URLs."""
        links = [word for url in others for word in ("--link", url)]
        hub = TcpHub(self._build, allowed_cpus()[:1], ["--accept-links", *links, *limits], hub_id=len(self.hubs) + 1)
        self.hubs.append(self.enter_context(hub))
        return hub

    def chain(self, count: int, limits: list[str] = []) -> "Network":
        for _ in range(count):
            self.add(*(hub.urls["unix"] for hub in self.hubs[-1:]), limits=limits)
        self.await_all()
        return self

    def ask(self, hub: TcpHub, *words: str):
        return json.loads(run_program([str(self._build / "bin" / "gimnet"), "--hub", hub.urls["unix"], *words, "--json"]))

    def ways(self, hub: TcpHub) -> dict[int, int]:
        """{hub that can be reached: next hop}."""
        return {each["id"]: each["via"] for each in self.ask(hub, "hubs") if each["reachable"]}

    def await_all(self) -> None:
        for hub in self.hubs:
            await_that(lambda hub=hub: len(self.ways(hub)) == len(self.hubs), f"{len(self.hubs)} hubs")

    def gimnet(self, hub: TcpHub, *words: str, **pipes) -> subprocess.Popen:
        """The tool, until this ends."""
        process = subprocess.Popen([str(self._build / "bin" / "gimnet"), "--hub", hub.urls["unix"], *words], **{"stdin": subprocess.DEVNULL,
                                   "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "preexec_fn": child_setup(allowed_cpus()[-1:])} | pipes)
        self.callback(process.wait)
        self.callback(process.kill)
        return process

    def used_ns(self) -> int:
        """The processor time of all threads of the hubs."""
        tasks = (task for hub in self.hubs for task in pathlib.Path(f"/proc/{hub.pid}/task").iterdir())
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks)


def await_that(holds: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + PATIENCE_SECONDS
    while not holds():
        if time.monotonic() > deadline:
            raise SubjectError(f"not within {PATIENCE_SECONDS} s: {what}")


def has_node(network: Network, hub: TcpHub, name: str) -> bool:
    return any(node["name"] == name and node["connected"] for node in network.ask(hub, "nodes"))


def run_pair(build: pathlib.Path, network: Network, roles: tuple[str, str], size: int, far: int = -1) -> dict[str, float]:
    """What the asking program at the first hub found of one that answers at the hub `far`, and `hub_ns`: CPU of all hubs a frame."""
    first, last = network.hubs[0], network.hubs[far]
    command = [str(build / "bin" / CLIENTS["tcphub"]), "--size", str(size), "--seconds", str(SECONDS), "--hub", str(first.pid)]
    partner = subprocess.Popen([*command, "--connect", last.urls["tcp"], "--role", roles[0]], stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, preexec_fn=child_setup(allowed_cpus()[-1:]))
    try:
        if read_line(partner) is None:
            raise SubjectError("the answering program was not ready in time")
        await_that(lambda: has_node(network, first, "second"), "its name at the first hub")
        used, frames = network.used_ns(), network.ask(last, "status")["ledger"]["accepted"]
        found = json.loads(run_program(["taskset", "-c", str(allowed_cpus()[-1]), *command, "--connect", first.urls["tcp"], "--role", roles[1],
                                        "--partner", str(partner.pid)]))
        frames = network.ask(last, "status")["ledger"]["accepted"] - frames
        if found["lost"] or found["wrong"]:
            raise SubjectError(f"messages were lost ({found['lost']:.0f}) or wrong ({found['wrong']:.0f})")
        return found | {"hub_ns": (network.used_ns() - used) / frames}
    finally:
        partner.kill()
        partner.communicate()
        await_that(lambda: not has_node(network, first, "second"), "its end at the first hub")


def compare_paths(build: pathlib.Path) -> Iterator[tuple[str, float]]:
    """Ratios to one hub, in turns."""
    with Network(build) as one, Network(build) as two, Network(build) as three:
        one.chain(1), two.chain(2), three.chain(3)
        for _ in range(RUNS):
            for size in SIZES:
                base, chain = (run_pair(build, network, ("receiver", "sender"), size)["hub_ns"] for network in (one, three))
                yield f"cpu_{size}", chain / base
            base, path = (run_pair(build, network, ("echo", "pinger"), 16)["p50_us"] for network in (one, two))
            yield "round_trip", path / base


def compare_cut_off(build: pathlib.Path) -> Iterator[tuple[str, float]]:
    """A hub whose only neighbour is gone, for its own nodes, beside one whose neighbour is there."""
    with Network(build) as whole, Network(build) as cut_off:
        whole.chain(2), cut_off.chain(2)
        subprocess.run(["kill", "-9", str(cut_off.hubs[1].pid)], check=True)
        for _ in range(RUNS):
            for figure, roles, found in (("rate", ("receiver", "sender"), "messages_per_second"), ("round_trip", ("echo", "pinger"), "p50_us")):
                base, alone = (run_pair(build, network, roles, 16, far=0)[found] for network in (whole, cut_off))
                yield f"cut_off_{figure}", alone / base


def compare_beside_slow(build: pathlib.Path) -> Iterator[tuple[str, float]]:
    """Others over a link beside a node that stands still behind it with all its lanes full, and without it."""
    for _ in range(RUNS):
        with Network(build) as network, tempfile.NamedTemporaryFile() as lines:
            lines.write(b"".join(b"%d" % number + b"x" * 30_000 + b"\n" for number in range(200)))
            lines.flush()
            first, last = network.chain(2, PATIENT).hubs

            def look() -> tuple[float, float]:
                words = ("ping", "target", "--lane", "real_time", "-c", "500", "-i", "0.002")
                return run_pair(build, network, ("receiver", "sender"), 16)["messages_per_second"], network.ask(first, *words)["p99"]
            slow = network.gimnet(last, "recv", "--name", "slow")
            network.gimnet(last, "recv", "--name", "target")
            await_that(lambda: has_node(network, first, "slow") and has_node(network, first, "target"), "the names")
            rate, ping = look()
            slow.send_signal(signal.SIGSTOP)
            for lane in LANES:
                network.gimnet(first, "send", "slow", "--lane", lane, stdin=network.enter_context(open(lines.name, "rb")))
            await_that(lambda: any(each["name"] == "slow" and each["queued_bytes"] > 4 * 50_000 for each in network.ask(last, "ctl", "connections")),
                       "full lanes")
            rate_beside, ping_beside = look()
        yield "beside_rate", rate_beside / rate
        yield "beside_ping_p99", ping_beside / ping


def time_convergence(build: pathlib.Path, seed: int) -> float:
    """Seconds from the last start until each hub of a mesh knows a way to every other."""
    choose = random.Random(seed)
    with Network(build) as network:
        for count in range(HUBS):
            network.add(*(hub.urls["unix"] for hub in choose.sample(network.hubs, min(count, 3))))
        begin = time.monotonic()
        network.await_all()
        return time.monotonic() - begin


def time_reroute(build: pathlib.Path, orders: bytes) -> float:
    """Milliseconds until hub 3 goes over hub 2 to hub 1, once its own link to hub 1 is given these orders."""
    with Network(build) as network:
        first = network.add()
        second = network.add(first.urls["unix"])
        relay = subprocess.Popen([str(build / "bin" / "gimnet"), "impair", "tcp://127.0.0.1:0", first.urls["tcp"]],
                                 stdin=subprocess.PIPE, stdout=subprocess.PIPE, preexec_fn=child_setup(allowed_cpus()))
        with relay:
            third = network.add(second.urls["unix"], (read_line(relay) or "ready -").split()[1])
            await_that(lambda: network.ways(third).get(1) == 1, "the short way")
            relay.stdin.write(orders)
            relay.stdin.flush()
            begin = time.monotonic()
            await_that(lambda: network.ways(third).get(1) == 2, "the other way")
            taken = time.monotonic() - begin
            relay.kill()
        return taken * 1e3


def measure(build: pathlib.Path) -> dict:
    build = build.resolve()
    figures: dict = {name: [] for name in GOALS}
    for name, value in itertools.chain(compare_paths(build), compare_cut_off(build), compare_beside_slow(build)):
        figures[name].append(value)
    for seed in range(RUNS):
        figures["converged_s"].append(time_convergence(build, seed))
        figures["closed_ms"].append(time_reroute(build, b"refuse\ncut\n"))
        figures["silent_ms"].append(time_reroute(build, b"stall\n"))
    return {"figures": figures}


def describe(document: dict) -> str:
    """One paragraph for docs/performance.md, of what is kept."""
    machine = document["machine"]

    def of(name: str) -> str:
        values = document["figures"][name]
        return f"{shown(statistics.median(values))} ({shown(min(values))} to {shown(max(values))}; goal {shown(GOALS[name])})"
    text = (f"{document['date']}, {machine['processor']}, {machine['cpus_allowed']} processors, GIMnet {document['version']}; medians of {RUNS}. "
            f"Hubs use one processor, programs another. A chain of three hubs costs {of('cpu_16')} times the CPU of one hub for a message of 16 bytes, "
            f"and {of('cpu_65536')} for 64 KiB. A round trip over two hubs takes {of('round_trip')} times as long as over one. {HUBS} hubs in a mesh know "
            f"each other {of('converged_s')} s after the last one started. Frames go another way {of('closed_ms')} ms after a link was closed, and "
            f"{of('silent_ms')} ms after it fell silent. A hub that is cut off has {of('cut_off_rate')} of its rate and {of('cut_off_round_trip')} times "
            f"its round trip. Beside a node with all lanes full others over its link keep {of('beside_rate')} of their rate, and a ping in lane 0 has "
            f"{of('beside_ping_p99')} times its 99th percentile.")
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)
