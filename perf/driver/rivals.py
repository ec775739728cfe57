"""Other hubs to compare with: Debian's packages, each as its documentation would have it for messages that need not be
kept, and in its favour: nothing on disk, no passwords, TCP_NODELAY, limits that do not stand in the way."""

import os
import pathlib
import shutil
import socket
import time

from driver.subjects import READY_SECONDS, Subject, SubjectError

# Debian keeps servers where a user's PATH does not look.
SERVER_FOLDERS = ("/usr/sbin", "/usr/local/sbin", "/sbin")


def find_program(name: str) -> str | None:
    return shutil.which(name, path=os.pathsep.join([os.environ.get("PATH", os.defpath), *SERVER_FOLDERS]))


def free_port() -> int:
    """Free when this returns; a start that finds it taken is tried again with another."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Rival(Subject):
    """A server that does not tell when it is ready: it is when it takes a connection."""

    program = ""
    package = ""
    prints_ready = False
    starts_max = 3

    def __init__(self, build: pathlib.Path, cpus: list[int]):
        super().__init__(build, cpus)
        self._port = 0

    @classmethod
    def why_absent(cls, build: pathlib.Path) -> str | None:
        return None if find_program(cls.program) else f"{cls.program} is not installed (package {cls.package})"

    def __enter__(self) -> "Rival":
        for attempt in range(self.starts_max):
            self._port = free_port()
            try:
                return super().__enter__()
            except SubjectError:
                if attempt == self.starts_max - 1:
                    raise
        raise AssertionError("not reached")

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
    wire = "nats"
    program = "nats-server"
    package = "nats-server"
    transports = ("tcp",)

    def command(self, folder: str) -> list[str]:
        pathlib.Path(folder, "nats.conf").write_text(f"listen: 127.0.0.1:{self._port}\nmax_connections: 100000\n")
        return [find_program(self.program), "-c", f"{folder}/nats.conf"]


class Mosquitto(Rival):
    name = "mosquitto"
    wire = "mqtt"
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


class Redis(Rival):
    name = "redis"
    wire = "resp"
    program = "redis-server"
    package = "redis-server"

    def command(self, folder: str) -> list[str]:
        return [find_program(self.program), "--port", str(self._port), "--bind", "127.0.0.1", "--unixsocket",
                f"{folder}/socket", "--dir", folder, "--save", "", "--appendonly", "no", "--daemonize", "no",
                "--maxclients", "20000", "--tcp-backlog", "4096"]

    def unix_path(self, folder: str) -> str:
        return f"{folder}/socket"


class ZeroMq(Subject):
    """perf/zeromq_proxy.cpp: publishers have an address of their own."""

    name = "zeromq"
    wire = "zmtp"

    @classmethod
    def why_absent(cls, build: pathlib.Path) -> str | None:
        there = (build / "bin" / "zeromq_proxy").exists()
        return None if there else "zeromq_proxy was not built: no libzmq (package libzmq3-dev)"

    def command(self, folder: str) -> list[str]:
        return [str(self._build / "bin" / "zeromq_proxy"), "--subscribe", "tcp://127.0.0.1:0", "--subscribe",
                f"ipc://{folder}/subscribe", "--publish", "tcp://127.0.0.1:0", "--publish", f"ipc://{folder}/publish"]

    def take_ready(self, urls: list[str]) -> None:
        if len(urls) != 4:
            raise SubjectError(f"{self.name} did not print its four addresses, but: {' '.join(urls)}")
        self.urls = {"tcp": urls[0], "unix": urls[1]}
        self.publish_urls = {"tcp": urls[2], "unix": urls[3]}


RIVALS = (Nats, Mosquitto, Redis, ZeroMq)
