"""tcphub and gimnet as processes. Where the programs are says GIMNET_BIN, else build/release/bin of this checkout."""

import json
import os
import pathlib
import signal
import subprocess
import tempfile
import threading

from support.waiting import PATIENCE_S, wait_until

ROOT = pathlib.Path(__file__).resolve().parents[3]
BIN = pathlib.Path(os.environ.get("GIMNET_BIN", ROOT / "build" / "release" / "bin"))
# What hubs and nodes leave for their next life belongs to the test, not to the user who runs it.
HOME = tempfile.TemporaryDirectory(prefix="gimnet-test-home-")
TCPHUB = str(BIN / "tcphub")
GIMNET = str(BIN / "gimnet")


class Process:
    """A program whose output is gathered in memory by threads. Ended, at the latest, by end()."""

    def __init__(self, arguments, stdin=subprocess.DEVNULL, env=None):
        environment = dict(os.environ)
        environment.pop("GIMNET_HUB", None)
        environment.pop("STATE_DIRECTORY", None)
        environment.update({"XDG_RUNTIME_DIR": HOME.name, "XDG_STATE_HOME": HOME.name}, **(env or {}))
        self.popen = subprocess.Popen(arguments, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                      env=environment)
        self._out, self._err = bytearray(), bytearray()
        self._threads = [threading.Thread(target=self._drain, args=pair, daemon=True)
                         for pair in ((self.popen.stdout, self._out), (self.popen.stderr, self._err))]
        for thread in self._threads:
            thread.start()

    @staticmethod
    def _drain(stream, into):
        while chunk := stream.read1(1 << 20):
            into += chunk
        stream.close()

    @property
    def out(self):
        return bytes(self._out)

    @property
    def out_size(self):
        return len(self._out)

    @property
    def err(self):
        return self._err.decode(errors="replace")

    def feed(self, data):
        """Writes all of standard input and closes it, from a thread of its own."""
        def run():
            try:
                self.popen.stdin.write(data)
                self.popen.stdin.close()
            except BrokenPipeError:
                pass
        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        self._threads.append(thread)
        return self

    def wait(self, patience_s=2 * PATIENCE_S):
        """The exit code, when all output was read."""
        try:
            code = self.popen.wait(patience_s)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            raise AssertionError(f"{self.popen.args} did not end within {patience_s} s; it said: {self.err}") from None
        for thread in self._threads:
            thread.join(PATIENCE_S)
        return code

    def signal(self, number):
        self.popen.send_signal(number)

    def end(self):
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGCONT)
            self.popen.kill()
        self.popen.wait()
        for thread in self._threads:
            thread.join(PATIENCE_S)
        if self.popen.stdin:
            try:
                self.popen.stdin.close()
            except BrokenPipeError:
                pass


class Hub:
    """A tcphub of its own, on a free port and a Unix socket in a folder of its own. Ends with the test."""

    def __init__(self, test, *arguments, shards=1, hub_id=7, listen=None, state=None):
        self._how = {"shards": shards, "hub_id": hub_id}
        self._arguments = arguments
        self._folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        test.addCleanup(self._folder.cleanup)
        self.socket_path = os.path.join(self._folder.name, "hub.sock")
        self.state = state or os.path.join(self._folder.name, "state")
        listen = listen or ["tcp://127.0.0.1:0", f"unix:{self.socket_path}"]
        words = [TCPHUB, "--shards", str(shards), "--hub-id", str(hub_id), "--placement", "hint",
                 "--state-dir", self.state]
        for address in listen:
            words += ["--listen", address]
        self.process = Process(words + list(arguments))
        test.addCleanup(self.process.end)
        line = wait_until(lambda: self._ready_line(), f"ready line of tcphub; it said: {self.process.err}")
        self.addresses = line.split()[1:]
        self.url = self.addresses[0]
        self.socket_path = next((url[5:] for url in self.addresses if url.startswith("unix:")), None)

    def again(self, test):
        """The hub started anew: same arguments, addresses and state. Its process has ended."""
        return Hub(test, *self._arguments, **self._how, listen=self.addresses, state=self.state)

    def _ready_line(self):
        line, newline, _ = self.process.out.partition(b"\n")
        if newline:
            return line.decode()
        if self.process.popen.poll() is not None:
            raise AssertionError(f"tcphub ended: {self.process.err}")
        return None

    @property
    def port(self):
        return int(self.url.rsplit(":", 1)[1])

    def status(self):
        return json.loads(run_gimnet(self, "status", "--json").out)

    def nodes(self):
        return json.loads(run_gimnet(self, "nodes", "--json").out)

    def counter(self, name):
        return self.status()["counters"][name]

    def quiet_status(self, test):
        """The status as soon as nothing moves: two in a row with the same ledger, which must be exact."""
        last = [None]

        def settled():
            status = self.status()
            same = last[0] is not None and last[0]["ledger"] == status["ledger"] and status["ledger"]["exact"]
            last[0] = status
            return status if same else None
        status = wait_until(settled, "a quiet hub with an exact ledger")
        test.assertTrue(status["ledger"]["exact"], status["ledger"])
        return status

    def wait_for_node(self, name):
        def there():
            return next((node for node in self.nodes() if node["name"] == name), None)
        return wait_until(there, f"node {name}")


def start_gimnet(test, hub, *arguments, stdin=subprocess.DEVNULL):
    """gimnet, running; ends with the test."""
    process = Process([GIMNET, "--hub", hub.url if hasattr(hub, "url") else hub, *arguments], stdin=stdin)
    test.addCleanup(process.end)
    return process


def run_gimnet(hub, *arguments, data=b"", patience_s=2 * PATIENCE_S):
    """gimnet from start to end. Its `code`, `out` and `err`."""
    process = Process([GIMNET, "--hub", hub.url if hasattr(hub, "url") else hub, *arguments],
                      stdin=subprocess.PIPE).feed(data)
    try:
        process.code = process.wait(patience_s)
    finally:
        process.end()
    return process


def start_recv(test, hub, name, *arguments):
    """`gimnet recv`, known to the hub."""
    process = start_gimnet(test, hub, "recv", "--name", name, "--raw", *arguments)
    hub.wait_for_node(name)
    return process
