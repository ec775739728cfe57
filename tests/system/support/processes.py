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
    """A program whose output is gathered in memory by threads, or goes to a file of the test's. Ended, at the latest, by
    end()."""

    def __init__(self, arguments, stdin=subprocess.DEVNULL, env=None, stdout=subprocess.PIPE):
        # LD_PRELOAD is for a test that loads the library itself, and not for programs.
        unwanted = ("GIMNET_HUB", "GIMNET_PROXY", "STATE_DIRECTORY", "LD_PRELOAD")
        environment = {name: value for name, value in os.environ.items() if name not in unwanted}
        environment.update({"XDG_RUNTIME_DIR": HOME.name, "XDG_STATE_HOME": HOME.name}, **(env or {}))
        self.popen = subprocess.Popen(arguments, stdin=stdin, stdout=stdout, stderr=subprocess.PIPE, env=environment)
        self._out, self._err = bytearray(), bytearray()
        self._threads = [threading.Thread(target=self._drain, args=pair, daemon=True)
                         for pair in ((self.popen.stdout, self._out), (self.popen.stderr, self._err)) if pair[0]]
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
    """A tcphub of its own, on a free port and a Unix socket in a folder of its own. Ends with the test, at whose end it has
    to have an exact ledger, if it lives then."""

    def __init__(self, test, *arguments, shards=1, hub_id=7, listen=None, state=None, netns=None, env=None,
                 program=TCPHUB):
        """`hub_id`: None for the default. `listen`: URLs, or what gives them for the URL of its Unix socket. `netns`: a network namespace to run in."""
        self._how = {"shards": shards, "hub_id": hub_id, "netns": netns, "env": env, "program": program}
        self._arguments = arguments
        self._folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        test.addCleanup(self._folder.cleanup)
        self.socket_path = os.path.join(self._folder.name, "hub.sock")
        self.state = state or os.path.join(self._folder.name, "state")
        listen = listen or ["tcp://127.0.0.1:0", f"unix:{self.socket_path}"]
        if callable(listen):
            listen = listen(f"unix:{self.socket_path}")
        words = ["ip", "netns", "exec", netns] if netns else []
        words += [program, "--shards", str(shards), "--placement", "hint", "--state-dir", self.state]
        if hub_id:
            words += ["--hub-id", str(hub_id)]
        for address in listen:
            words += ["--listen", address]
        self.process = Process(words + list(arguments), env=env)
        test.addCleanup(self.process.end)
        line = wait_until(lambda: self._ready_line(), f"ready line of tcphub; it said: {self.process.err}")
        self.addresses = line.split()[1:]
        self.url = self.addresses[0]
        self.socket_path = next((url[5:] for url in self.addresses if url.startswith("unix:")), None)
        # Where a hub that is full, or that others swamp, still takes somebody who asks.
        self._admin_url = self.addresses[-1]
        test.addCleanup(self._look_at_its_end, test)

    def _look_at_its_end(self, test):
        """Behind all who came to it: their connections are closed by now."""
        code = self.process.popen.poll()
        if code is None:
            try:
                self.quiet_status(test)
                return
            except AssertionError:
                if not self.socket_path or os.path.exists(self.socket_path):
                    raise
            code = self.process.wait()  # it drains: it takes nobody who asks any more
        test.assertIn(code, (0, -signal.SIGKILL), f"tcphub ended by itself: {self.process.err}")

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
            asked = run_gimnet(self._admin_url, "status", "--json")
            test.assertEqual(asked.code, 0, asked.err)
            status = json.loads(asked.out)
            same = last[0] is not None and last[0]["ledger"] == status["ledger"] and status["ledger"]["exact"]
            last[0] = status
            return status if same else None
        try:
            return wait_until(settled, "a quiet hub with an exact ledger")
        except AssertionError as error:
            raise AssertionError(f"{error}; it was last {last[0] and last[0]['ledger']}") from None

    def expect_ledger(self, test, accepted, delivered, copies=0, dropped=None, queued=0):
        """The hub's ledger is, at a quiet moment, what senders and receivers counted themselves: numbers, or functions that
        count. `dropped`: {reason: frames}, all that there are. Returns the status."""
        seen = [None]

        def number(term):
            return term() if callable(term) else term

        def as_counted():
            status = self.quiet_status(test)
            terms = {key: status["ledger"][key] for key in ("accepted", "copies", "delivered", "queued")}
            reasons = {name[len("dropped."):]: value for name, value in status["counters"].items()
                       if name.startswith("dropped.") and value}
            wanted = {"accepted": number(accepted), "copies": number(copies), "delivered": number(delivered),
                      "queued": number(queued)}
            wanted_reasons = {reason: number(term) for reason, term in (dropped or {}).items() if number(term)}
            seen[0] = (terms, reasons), (wanted, wanted_reasons)
            return status if seen[0][0] == seen[0][1] else None
        try:
            return wait_until(as_counted, "the ledger as it was counted")
        except AssertionError:
            test.assertEqual(*seen[0], "what the hub counted, and what others did")
            raise

    def wait_for_node(self, name):
        def there():
            return next((node for node in self.nodes() if node["name"] == name and node["connected"]), None)
        return wait_until(there, f"node {name}")


def start_gimnet(test, hub, *arguments, **pipes):
    """gimnet, running; ends with the test. `pipes`: stdin and stdout as of Process."""
    process = Process([GIMNET, "--hub", hub.url if hasattr(hub, "url") else hub, *arguments], **pipes)
    test.addCleanup(process.end)
    return process


def run_gimnet(hub, *arguments, data=b"", patience_s=2 * PATIENCE_S, env=None):
    """gimnet from start to end. Its `code`, `out` and `err`."""
    process = Process([GIMNET, "--hub", hub.url if hasattr(hub, "url") else hub, *arguments],
                      stdin=subprocess.PIPE, env=env).feed(data)
    try:
        process.code = process.wait(patience_s)
    finally:
        process.end()
    return process


def start_recv(test, hub, name, *arguments, **pipes):
    """`gimnet recv`, known to the hub."""
    process = start_gimnet(test, hub, "recv", "--name", name, "--raw", *arguments, **pipes)
    hub.wait_for_node(name)
    return process
