"""The programs that are measured: which there are, and how each is started, pinned to its processor, found ready, and ended.

Other hubs are Debian's packages, each as its documentation would have it for messages that need not be kept, and in its favour: nothing
on disk, no passwords, TCP_NODELAY, limits that do not stand in the way. They are measured with their own libraries."""

import ctypes
import os
import pathlib
import re
import resource
import select
import shutil
import signal
import socket
import subprocess
import tempfile
import time

from driver.suite import Case

READY_SECONDS = 15
PR_SET_PDEATHSIG = 1
# Where the system lets it, a subject may hold so many connections: some refuse what 10,000 and their own files need.
DESCRIPTORS_MIN = 65_536
# The hub sets this on every connection (`socket_send_bytes`); the null relay gets the same.
SEND_BUFFER_BYTES = 256 * 1024
# Debian keeps servers where a user's PATH does not look.
SERVER_FOLDERS = ("/usr/sbin", "/usr/local/sbin", "/sbin")


class SubjectError(Exception):
    """A subject did not start, or ended before it was told to."""


def allowed_cpus() -> list[int]:
    return sorted(os.sched_getaffinity(0))


def child_setup(cpus: list[int]):
    """For subprocess: pins the child, lets it hold many connections, and ends it when this program dies."""
    libc = ctypes.CDLL(None, use_errno=True)
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)

    def set_up():
        os.sched_setaffinity(0, cpus)
        for descriptors in (max(hard, DESCRIPTORS_MIN), hard):
            try:
                resource.setrlimit(resource.RLIMIT_NOFILE, (descriptors, descriptors))
                break
            except (OSError, ValueError):
                pass  # more than the hard limit is root's to give
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)

    return set_up


def read_line(process: subprocess.Popen) -> str | None:
    """The first line that a program prints; None: it ended, or printed none within READY_SECONDS."""
    deadline = time.monotonic() + READY_SECONDS
    line = b""
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([process.stdout], [], [], max(0.0, deadline - time.monotonic()))
        piece = os.read(process.stdout.fileno(), 4096) if ready else b""
        if not piece:
            if ready:
                process.wait(READY_SECONDS)
            return None
        line += piece
    return line.decode()


class Subject:
    """A running hub or relay, for `with`. Listens on TCP and, unless `transports` says otherwise, on a Unix socket."""

    name = ""
    transports = ("tcp", "unix")
    prints_ready = True  # `ready URL...` on standard output; otherwise that belongs to its log

    def __init__(self, build: pathlib.Path, cpus: list[int]):
        self._build = build
        self._cpus = cpus
        self._process: subprocess.Popen | None = None
        self.urls: dict[str, str] = {}

    def command(self, folder: str) -> list[str]:
        raise NotImplementedError

    def __enter__(self) -> "Subject":
        self._folder = tempfile.TemporaryDirectory(prefix="gimnet-perf-")
        self._log = open(os.path.join(self._folder.name, "log"), "w+b")
        command = self.command(self._folder.name)
        try:
            output = subprocess.PIPE if self.prints_ready else self._log
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=self._log,
                                             preexec_fn=child_setup(self._cpus))
            self._await_ready()
        except OSError as error:
            self._close()
            raise SubjectError(f"{self.name} cannot be started: {error}") from None
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *_) -> None:
        self._close()

    @property
    def pid(self) -> int:
        return self._process.pid

    def check_alive(self) -> None:
        """Raises SubjectError, with the end of its log, when it is gone."""
        status = self._process.poll()
        if status is None:
            return
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"
        raise SubjectError(f"{self.name} ended by itself with {how}: {self._log_end()}")

    def _await_ready(self) -> None:
        line = read_line(self._process)
        if line is None:
            self.check_alive()
            raise SubjectError(f"{self.name} was not ready within {READY_SECONDS} s: {self._log_end()}")
        words = line.split()
        if len(words) < 3 or words[0] != "ready":
            raise SubjectError(f"{self.name} did not print its addresses, but: {line.strip()}")
        self.urls = {"unix" if url.startswith("unix:") else "tcp": url for url in words[1:]}

    def _log_end(self) -> str:
        self._log.seek(0)
        return self._log.read()[-2000:].decode(errors="replace").strip() or "it logged nothing"

    def _close(self) -> None:
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(2)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            if self._process.stdout is not None:
                self._process.stdout.close()
            self._process = None
        self._log.close()
        self._folder.cleanup()


class NullRelay(Subject):
    """The yardstick."""

    name = "null"

    def __init__(self, build: pathlib.Path, cpu: int, mode: str):
        super().__init__(build, [cpu])
        self._mode = mode

    def command(self, folder: str) -> list[str]:
        return [str(self._build / "bin" / "null_relay"), "--mode", self._mode, "--listen", "tcp://127.0.0.1:0",
                "--listen", f"unix:{folder}/socket", "--send-buffer", str(SEND_BUFFER_BYTES)]


class TcpHub(Subject):
    """The shipped hub as it starts by default, apart from where it listens."""

    name = "tcphub"

    def __init__(self, build: pathlib.Path, cpus: list[int], arguments: list[str], name: str = "tcphub", hub_id: int = 7):
        super().__init__(build, cpus)
        self._arguments = ["--hub-id", str(hub_id), *arguments]
        self.name = name

    def command(self, folder: str) -> list[str]:
        return [str(self._build / "bin" / "tcphub"), "--listen", "tcp://127.0.0.1:0", "--listen",
                f"unix:{folder}/socket", "--state-dir", f"{folder}/state", *self._arguments]


def find_program(name: str) -> str | None:
    return shutil.which(name, path=os.pathsep.join([os.environ.get("PATH", os.defpath), *SERVER_FOLDERS]))


def free_port() -> int:
    """Free when this returns; a run that finds it taken is made again with another."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Rival(Subject):
    """A server that does not tell when it is ready: it is when it takes a connection."""

    program = ""
    package = ""
    prints_ready = False

    def __init__(self, build: pathlib.Path, cpus: list[int]):
        super().__init__(build, cpus)
        self._port = 0

    def __enter__(self) -> "Rival":
        self._port = free_port()
        return super().__enter__()

    def _await_ready(self) -> None:
        deadline = time.monotonic() + READY_SECONDS
        while True:
            try:
                socket.create_connection(("127.0.0.1", self._port), timeout=1).close()
                self.check_alive()  # or somebody else has the port
                break
            except OSError:
                self.check_alive()
                if time.monotonic() > deadline:
                    raise SubjectError(f"{self.name} was not ready within {READY_SECONDS} s: {self._log_end()}") from None
                time.sleep(0.01)
        self.urls = {"tcp": f"tcp://127.0.0.1:{self._port}"}
        path = self.unix_path(self._folder.name)
        if path is not None:
            self.urls["unix"] = f"unix:{path}"

    def unix_path(self, folder: str) -> str | None:
        return None


class Nats(Rival):
    name = "nats"
    program = "nats-server"
    package = "nats-server"
    transports = ("tcp",)

    def command(self, folder: str) -> list[str]:
        pathlib.Path(folder, "nats.conf").write_text(f"listen: 127.0.0.1:{self._port}\nmax_connections: 100000\n")
        return [find_program(self.program), "-c", f"{folder}/nats.conf"]


class Mosquitto(Rival):
    name = "mosquitto"
    program = "mosquitto"
    package = "mosquitto"

    def command(self, folder: str) -> list[str]:
        lines = ["per_listener_settings false", f"listener {self._port} 127.0.0.1", f"listener 0 {folder}/socket",
                 "allow_anonymous true", "persistence false", "set_tcp_nodelay true", "sys_interval 0",
                 "connection_messages false", "log_type error", "log_dest stderr", "max_queued_messages 0"]
        if os.geteuid() == 0:
            lines.append("user root")  # or it gives its rights up, and cannot make its socket in the folder
        pathlib.Path(folder, "mosquitto.conf").write_text("\n".join(lines) + "\n")
        return [find_program(self.program), "-c", f"{folder}/mosquitto.conf"]

    def unix_path(self, folder: str) -> str:
        return f"{folder}/socket"


class CycloneDds(Rival):
    """Has no hub: a program that sleeps stands in its place."""

    name = "cyclonedds"
    program = "sleep"
    package = "cyclonedds-dev"
    transports = ("tcp",)

    def command(self, folder: str) -> list[str]:
        return [find_program(self.program), "infinity"]

    def _await_ready(self) -> None:
        self.urls = {"tcp": "tcp://127.0.0.1:0"}


HUBS = {"tcphub": [], "tcphub_2_shards": ["--shards", "2"], "tcphub_spinning": ["--spin"]}
RIVAL_CLASSES = {rival.name: rival for rival in (Nats, Mosquitto, CycloneDds)}
CLIENTS = {name: f"library_client_{name}" for name in RIVAL_CLASSES} | {"tcphub": "library_client_nif"}
SUBJECTS = ("null", *HUBS, *RIVAL_CLASSES)
LIBRARY_PACKAGES = {"nats": "libnats-dev", "mosquitto": "libmosquitto-dev", "cyclonedds": "cyclonedds-dev"}


def why_absent(name: str, case: Case, build: pathlib.Path) -> str | None:
    """Why there will be no row of this subject for this case; None: there will be one."""
    if name not in RIVAL_CLASSES:
        return "a relay without queues says nothing here" if name == "null" and case.baseline is None else None
    rival = RIVAL_CLASSES[name]
    if case.spec.roles is None:
        return "other hubs are measured by their libraries only"
    if case.transport not in rival.transports:
        return "it has no Unix socket"
    if name == "cyclonedds" and case.scenario != "library_burst":
        return "it is measured in bursts only"
    if name == "mosquitto" and case.scenario == "library_request":
        return "its library has no requests"
    if not (build / "bin" / CLIENTS[name]).exists():
        return f"{CLIENTS[name]} was not built: no library (package {LIBRARY_PACKAGES[name]})"
    return None if find_program(rival.program) else f"{rival.program} is not installed (package {rival.package})"


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


def rival_versions(names: list[str]) -> dict[str, str]:
    """What of the other hubs and their libraries is installed, and its version."""
    versions = {}
    for name in (name for name in names if name in RIVAL_CLASSES):
        for package in (LIBRARY_PACKAGES[name], RIVAL_CLASSES[name].package):
            done = subprocess.run(["dpkg-query", "-W", "-f=${Version}", package], capture_output=True, text=True, check=False)
            if found := re.search(r"\d+\.\d+(\.\d+)*", done.stdout):
                versions[package.removesuffix("-dev").removesuffix("-server")] = found.group(0)
    return versions
