"""The programs that are measured: how each is started, pinned to its processor, found ready, and ended."""

import ctypes
import fcntl
import glob
import io
import os
import pathlib
import resource
import select
import shutil
import signal
import subprocess
import tempfile
import time

READY_SECONDS = 15
PR_SET_PDEATHSIG = 1
# Where the system lets it, a subject may hold so many connections: some refuse what 10,000 and their own files need.
DESCRIPTORS_MIN = 65_536
FOLDER_PREFIX = "gimnet-perf-"
LOCK = "in-use"
# The hub sets this on every connection (`socket_send_bytes`); the null relay gets the same.
SEND_BUFFER_BYTES = 256 * 1024


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


def lock_folder(folder: str) -> io.FileIO:
    """Who has it open says that the folder is in use; the kernel lets it go with the process, however that ends."""
    lock = open(os.path.join(folder, LOCK), "wb", buffering=0)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise
    return lock


def remove_left_folders() -> None:
    """Those of runs that were killed and could not clear up."""
    for path in glob.glob(os.path.join(tempfile.gettempdir(), FOLDER_PREFIX + "*", LOCK)):
        try:
            with lock_folder(os.path.dirname(path)):
                shutil.rmtree(os.path.dirname(path), ignore_errors=True)
        except OSError:
            pass  # in use, or somebody else's


class Subject:
    """A running hub or relay, for `with`. Listens on TCP and, unless `transports` says otherwise, on a Unix socket."""

    name = ""
    wire = ""
    transports = ("tcp", "unix")
    prints_ready = True  # `ready URL...` on standard output; otherwise that belongs to its log

    def __init__(self, build: pathlib.Path, cpus: list[int]):
        self._build = build
        self._cpus = cpus
        self._process: subprocess.Popen | None = None
        self.urls: dict[str, str] = {}
        self.publish_urls: dict[str, str] = {}  # where it takes messages, if at other addresses

    def command(self, folder: str) -> list[str]:
        raise NotImplementedError

    def __enter__(self) -> "Subject":
        self._folder = tempfile.TemporaryDirectory(prefix=FOLDER_PREFIX)
        self._lock = lock_folder(self._folder.name)
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
        deadline = time.monotonic() + READY_SECONDS
        line = b""
        output = self._process.stdout.fileno()
        while not line.endswith(b"\n"):
            ready, _, _ = select.select([output], [], [], max(0.0, deadline - time.monotonic()))
            piece = os.read(output, 4096) if ready else b""
            if not piece:
                self._process.wait(1) if ready else None
                self.check_alive()
                raise SubjectError(f"{self.name} was not ready within {READY_SECONDS} s: {self._log_end()}")
            line += piece
        words = line.decode().split()
        if len(words) < 3 or words[0] != "ready":
            raise SubjectError(f"{self.name} did not print its addresses, but: {line.decode().strip()}")
        self.take_ready(words[1:])

    def take_ready(self, urls: list[str]) -> None:
        self.urls = {"unix" if url.startswith("unix:") else "tcp": url for url in urls}

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
        self._lock.close()
        self._folder.cleanup()


class NullRelay(Subject):
    """The yardstick."""

    name = "null"
    wire = "null"

    def __init__(self, build: pathlib.Path, cpu: int, mode: str):
        super().__init__(build, [cpu])
        self._mode = mode

    def command(self, folder: str) -> list[str]:
        return [str(self._build / "bin" / "null_relay"), "--mode", self._mode, "--listen", "tcp://127.0.0.1:0",
                "--listen", f"unix:{folder}/socket", "--send-buffer", str(SEND_BUFFER_BYTES)]


class TcpHub(Subject):
    """The shipped hub as it starts by default, apart from where it listens."""

    name = "tcphub"
    wire = "gimnet"

    def __init__(self, build: pathlib.Path, cpus: list[int], arguments: list[str], name: str = "tcphub"):
        super().__init__(build, cpus)
        self._arguments = arguments
        self.name = name

    def command(self, folder: str) -> list[str]:
        return [str(self._build / "bin" / "tcphub"), "--listen", "tcp://127.0.0.1:0", "--listen",
                f"unix:{folder}/socket", "--hub-id", "7", "--state-dir", f"{folder}/state", *self._arguments]
