#!/usr/bin/env python3
"""Links and nodes that reach a hub through an HTTP proxy: Debian's tinyproxy, and proxies that answer anything else."""

import json
import os
import shutil
import socket
import tempfile
import threading
import unittest

from support import skips
from support.processes import Hub, Process, run_gimnet, start_recv
from support.waiting import wait_until

PASSWORD = "open-sesame"


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as place:
        return place.getsockname()[1]


def reaches(hub, other):
    hubs = json.loads(run_gimnet(hub, "hubs", "--json").out or "[]")
    return any(each["id"] == other and each["reachable"] for each in hubs)


def link_error(hub, *words):
    """Waits until the link of a hub says these words, and gives all that it says."""
    def error():
        links = json.loads(run_gimnet(hub, "links", "--json").out or "[]")
        said = links[0]["last_error"] if links else None
        return said if said and all(word in said for word in words) else None
    return wait_until(error, f"a link's error with {words}")


class Tinyproxy:
    """A tinyproxy that ends with the test. `log`: the requests that it took."""

    def __init__(self, test, login="", port=None):
        self._test, self._login, self.port = test, login, port or free_port()
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        test.addCleanup(folder.cleanup)
        self._log = os.path.join(folder.name, "log")
        self._file = os.path.join(folder.name, "tinyproxy.conf")
        with open(self._file, "w", encoding="utf-8") as file:
            file.write(f"Port {self.port}\nListen 127.0.0.1\nMaxClients 50\nLogLevel Connect\nLogFile \"{self._log}\"\n")
            if login:
                file.write(f"BasicAuth {login.replace(':', ' ')}\n")
        self.url = f"http://{login}{'@' if login else ''}127.0.0.1:{self.port}"
        self.start()

    def start(self):
        self.process = Process(["tinyproxy", "-d", "-c", self._file])
        self._test.addCleanup(self.process.end)

        def listens():
            self._test.assertIsNone(self.process.popen.poll(), self.process.err)
            with socket.socket() as trial:
                return trial.connect_ex(("127.0.0.1", self.port)) == 0
        wait_until(listens, "tinyproxy")

    @property
    def log(self):
        with open(self._log, encoding="utf-8", errors="replace") as file:
            return file.read()


@unittest.skipUnless(shutil.which("tinyproxy"), "the package tinyproxy is not installed: apt-get install tinyproxy")
class ThroughTinyproxy(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self, "--accept-links", hub_id=1)

    def send(self, here, there, name):
        """From a node at one hub to one at another."""
        receiver = start_recv(self, there, name, "-n", "1")
        wait_until(lambda: run_gimnet(here, "nodes", name).code == 0, f"{name} at the other hub")
        big = os.urandom(500_000).replace(b"\n", b".") + b"\n"
        self.assertEqual(run_gimnet(here, "send", name, data=big).code, 0)
        self.assertEqual((receiver.wait(), receiver.out == big), (0, True), receiver.err)

    def test_a_link_goes_through_it_and_comes_back_when_it_was_away(self):
        proxy = Tinyproxy(self, login=f"ann:{PASSWORD}")
        far = Hub(self, hub_id=2)
        added = run_gimnet(f"unix:{far.socket_path}", "ctl", "link", "add", self.hub.url, "--proxy", proxy.url)
        self.assertEqual(added.code, 0, added.err)
        wait_until(lambda: reaches(far, 1) and reaches(self.hub, 2), "a link")
        self.assertIn(f"CONNECT {self.hub.url[6:]}", proxy.log)
        self.send(far, self.hub, "there")
        self.send(self.hub, far, "back")
        proxy.process.end()
        wait_until(lambda: not reaches(far, 1), "the end of the link")
        link_error(far, f"through the proxy http://ann:***@127.0.0.1:{proxy.port}", "is the proxy running there?")
        proxy.start()
        wait_until(lambda: reaches(far, 1) and reaches(self.hub, 2), "the link again")
        self.send(far, self.hub, "again")
        self.assertNotIn(PASSWORD, far.process.err + run_gimnet(far, "links", "--json").out.decode())

    def test_a_link_of_the_command_line_goes_through_that_of_the_environment(self):
        proxy = Tinyproxy(self)
        far = Hub(self, "--link", self.hub.url, hub_id=2, env={"GIMNET_PROXY": proxy.url})
        wait_until(lambda: reaches(far, 1), "a link")
        self.assertIn(f"CONNECT {self.hub.url[6:]}", proxy.log)

    def test_nodes_go_through_it(self):
        proxy = Tinyproxy(self, login=f"ann:{PASSWORD}")
        for how in ({"env": {"GIMNET_PROXY": proxy.url}}, {}):
            words = [] if how else ["--proxy", proxy.url]
            before = proxy.log.count("CONNECT")
            nodes = run_gimnet(self.hub, *words, "nodes", "--all", "--json", **how)
            self.assertEqual((nodes.code, len(json.loads(nodes.out))), (0, 1), nodes.err)
            self.assertGreater(proxy.log.count("CONNECT"), before)
        # The hub of this machine and Unix sockets need none.
        local = run_gimnet(f"unix:{self.hub.socket_path}", "nodes", env={"GIMNET_PROXY": "http://127.0.0.1:1"})
        self.assertEqual(local.code, 0, local.err)

    def test_a_wrong_password_is_told_and_not_shown(self):
        proxy = Tinyproxy(self, login=f"ann:{PASSWORD}")
        place = f"127.0.0.1:{proxy.port}"
        for login, words in (("", "it wants a user and a password; write them into its URL"),
                             ("ann:wrong-one@", "user or password is wrong; correct them in its URL")):
            asked = run_gimnet(self.hub, "--proxy", f"http://{login}{place}", "nodes")
            self.assertEqual((asked.code, asked.out), (3, b""), asked.err)
            self.assertIn(words, asked.err)
            self.assertNotIn("wrong-one", asked.err)
        far = Hub(self, "--link", self.hub.url, hub_id=2, env={"GIMNET_PROXY": f"http://ann:wrong-one@{place}"})
        link_error(far, "user or password is wrong")
        self.assertNotIn("wrong-one", far.process.err)

    def test_a_hub_that_is_not_there_is_told(self):
        proxy = Tinyproxy(self)
        asked = run_gimnet(f"tcp://127.0.0.1:{free_port()}", "--proxy", proxy.url, "nodes")
        self.assertEqual(asked.code, 3)
        self.assertIn("is the hub running there?", asked.err)


class FakeProxy:
    """Takes connections and, when CONNECT has come, does with each what it is told."""

    def __init__(self, test, answer):
        self._answer = answer
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        test.addCleanup(self._listener.close)
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while True:
            try:
                connection = self._listener.accept()[0]
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection):
        with connection:
            request = b""
            while not request.endswith(b"\r\n\r\n"):
                more = connection.recv(4096)
                if not more:
                    return
                request += more
            try:
                self._answer(connection)
            except OSError:
                pass  # the other end has heard enough


def says(answer):
    return lambda connection: connection.sendall(answer)


def endless(connection):
    connection.sendall(b"HTTP/1.1 200 OK\r\n")
    for _ in range(10_000):
        connection.sendall(b"X: " + b"x" * 1_000 + b"\r\n")


BAD = {
    "forbidden": (says(b"HTTP/1.1 403 Forbidden\r\n\r\n"), "ask its administrator to allow CONNECT to that port"),
    "no CONNECT": (says(b"HTTP/1.1 405 Method Not Allowed\r\n\r\n"), "name an HTTP proxy that does"),
    "bad gateway": (says(b"HTTP/1.1 502 Bad Gateway\r\n\r\n"), "is the hub running there?"),
    "unknown": (says(b"HTTP/1.1 418 \x1b[31mTeapot\r\n\r\n"), "418 ?[31mTeapot"),
    "garbage": (says(b"SSH-2.0-OpenSSH_9.2\r\n"), "it does not speak HTTP; is it an HTTP proxy?"),
    "nothing": (says(b""), "it closed the connection without an answer; is it an HTTP proxy?"),
    "10 MB of headers": (endless, "its answer to CONNECT is longer than 8 KiB"),
    "no hub": (says(b"HTTP/1.1 200 OK\r\n\r\nHTTP/1.1 400 Bad Request\r\n\r\n"), "does not speak GIMnet; is it a hub?"),
}


class BadAnswers(unittest.TestCase):
    """What is said at the dialling end; the rest goes on."""

    def test_they_are_told_with_the_remedy(self):
        hub = Hub(self, hub_id=2)
        admin = f"unix:{hub.socket_path}"
        # First, so that its time runs out while the others are looked at.
        mute = FakeProxy(self, lambda connection: connection.recv(1))
        words = {"never": "it does not answer CONNECT; is it an HTTP proxy?"}
        proxies = {"never": mute}
        for name, (answer, said) in BAD.items():
            words[name], proxies[name] = said, FakeProxy(self, answer)
        for name, proxy in proxies.items():
            added = run_gimnet(admin, "ctl", "link", "add", "tcp://127.0.0.1:9", "--name", name.replace(" ", "_"), "--proxy",
                               proxy.url)
            self.assertEqual(added.code, 0, added.err)
        for name, proxy in proxies.items():
            if name == "never":
                continue
            asked = run_gimnet("tcp://127.0.0.1:9", "--proxy", proxy.url, "nodes")
            self.assertEqual((asked.code, asked.out), (3, b""), (name, asked.err))
            self.assertIn(words[name], asked.err, name)
            self.assertIn(f"through the proxy {proxy.url}", asked.err, name)

        def all_told():
            links = {link["name"].replace("_", " "): link["last_error"] or ""
                     for link in json.loads(run_gimnet(hub, "links", "--json").out or "[]")}
            missing = [name for name in words if words[name] not in links.get(name, "")]
            return not missing
        wait_until(all_told, "what each link has to say")
        self.assertEqual(run_gimnet(hub, "status").code, 0, "the rest goes on")

    def test_a_url_with_a_typo(self):
        hub = Hub(self, hub_id=2)
        for url in ("htp://127.0.0.1:3128", "127.0.0.1:3128", f"http://ann:{PASSWORD}@127.0.0.1", "http://127.0.0.1:80a"):
            asked = run_gimnet(hub, "--proxy", url, "nodes")
            self.assertEqual(asked.code, 2, asked.err)
            self.assertIn("write http://HOST:PORT or http://USER:PASSWORD@HOST:PORT", asked.err)
            self.assertNotIn(PASSWORD, asked.err)
            added = run_gimnet(f"unix:{hub.socket_path}", "ctl", "link", "add", "tcp://127.0.0.1:9", "--proxy", url)
            self.assertEqual(added.code, 2, added.err)
            self.assertIn("write http://HOST:PORT", added.err)
        asked = run_gimnet(f"unix:{hub.socket_path}", "--proxy", "http://127.0.0.1:1", "nodes")
        self.assertEqual(asked.code, 2)
        self.assertIn("a socket of this machine: leave the proxy out", asked.err)


if __name__ == "__main__":
    skips.main()
