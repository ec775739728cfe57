#!/usr/bin/env python3
"""Where a hub keeps its state, and what it says when it cannot."""

import os
import shutil
import signal
import socket
import tempfile
import unittest

from support.processes import TCPHUB, Hub, Process, run_gimnet, start_recv
from support.waiting import wait_until
from support.wire import Client


class PlainHub:
    """tcphub with nothing but what the test says."""

    def __init__(self, test, *arguments, env=None):
        self.process = Process([TCPHUB, *arguments], env=env)
        test.addCleanup(self.process.end)

    def wait_ready(self):
        wait_until(lambda: self.process.out.startswith(b"ready ") and self.process.out.endswith(b"\n"), "ready line")
        self.port = int(self.process.out.split()[1].rsplit(b":", 1)[1])
        return self

    def wait_error(self):
        """What it says when it ends with 1."""
        code = self.process.wait(20)
        assert code == 1, f"{code}: {self.process.err}"
        return self.process.err

    def kill(self):
        self.process.signal(signal.SIGKILL)
        self.process.wait()


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        self.addCleanup(folder.cleanup)
        self.path = folder.name

    def test_the_default_one_is_for_an_address_and_outlives_the_hub(self):
        url = f"tcp://127.0.0.1:{free_port()}"
        env = {"XDG_STATE_HOME": self.path}
        first = PlainHub(self, "--listen", url, env=env).wait_ready()
        client = Client(self, first).join("K")
        folder = os.path.join(self.path, "gimnet", f"hub-tcp-127.0.0.1-{first.port}")
        self.assertEqual(sorted(os.listdir(folder)), ["lock", "state"])
        for name in ("lock", "state"):
            self.assertEqual(os.stat(os.path.join(folder, name)).st_mode & 0o777, 0o600)
        first.kill()
        second = PlainHub(self, "--listen", url, env=env).wait_ready()
        newcomer = Client(self, second).join("Z")
        self.assertNotEqual(newcomer.id, client.id)
        self.assertEqual(Client(self, second).join("K", token=client.welcome[2]).id, client.id)

    def test_the_hub_id_that_a_hub_with_links_draws_outlives_it(self):
        def hub_of_a_node(*arguments):
            hub = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", f"{self.path}/state", *arguments)
            found = Client(self, hub.wait_ready()).join("K").id >> 20
            hub.kill()
            return found
        self.assertEqual(hub_of_a_node(), 1)
        drawn = hub_of_a_node("--link", "unix:/nobody/listens")
        self.assertTrue(1024 <= drawn <= 4094, drawn)
        self.assertEqual(hub_of_a_node("--link", "unix:/nobody/listens"), drawn)
        self.assertEqual(hub_of_a_node(), drawn)
        self.assertEqual(hub_of_a_node("--hub-id", "7"), 7)

    def test_no_home_keeps_nobody_from_running_a_hub(self):
        url = f"tcp://127.0.0.1:{free_port()}"
        for home in ("", "/nonexistent/home"):
            hub = PlainHub(self, "--listen", url, env={"XDG_STATE_HOME": "", "HOME": home}).wait_ready()
            Client(self, hub).join("K")
            wait_until(lambda hub=hub: "--state-dir" in hub.process.err, "the warning in the log")
            hub.kill()

    def test_two_hubs_do_not_share_one(self):
        first = Hub(self)
        second = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", first.state)
        said = second.wait_error()
        self.assertIn(f"in use by tcphub (process {first.process.popen.pid})", said)
        self.assertIn("--state-dir", said)
        # After kill -9 the lock is nobody's.
        first.process.signal(signal.SIGKILL)
        first.process.wait()
        PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", first.state).wait_ready()

    def test_damage_is_told_and_moving_it_away_helps(self):
        state = os.path.join(self.path, "state-folder")
        PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state).wait_ready().kill()
        file = os.path.join(state, "state")
        with open(file, "r+b") as stream:
            stream.seek(20)
            byte = stream.read(1)
            stream.seek(20)
            stream.write(bytes([byte[0] ^ 1]))
        said = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state).wait_error()
        for part in (file, "damaged", "move it away"):
            self.assertIn(part, said)
        os.rename(file, file + ".old")
        anew = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state).wait_ready()
        wait_until(lambda: "begins anew" in anew.process.err, "the warning in the log")

    def test_links_and_folders_in_the_place_of_its_files_are_told(self):
        state = os.path.join(self.path, "state-folder")
        for name in ("state", "lock"):
            with self.subTest(name=name):
                os.mkdir(state, 0o700)
                os.symlink("elsewhere", os.path.join(state, name))
                said = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state).wait_error()
                self.assertIn(f"{os.path.join(state, name)}: it is a link, and links are not followed; put a file in its place", said)
                shutil.rmtree(state)
        os.mkdir(state, 0o700)
        os.mkdir(os.path.join(state, "state.new"))
        said = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state).wait_error()
        self.assertIn(f"{state}/state.new is in the way: it is a folder; remove it", said)

    def test_an_address_that_is_given_twice_is_told(self):
        one, other = f"unix:{self.path}/hub.sock", f"unix:{self.path}/./hub.sock"
        said = PlainHub(self, "--listen", one, "--listen", other, "--state-dir", os.path.join(self.path, "state")).wait_error()
        self.assertIn(f"cannot listen on {other}: the address is given twice: this hub listens there already, as {one};", said)

    def test_a_place_that_is_no_folder_is_told(self):
        path = os.path.join(self.path, "file")
        with open(path, "w", encoding="utf-8") as file:
            file.write("x")
        self.assertIn(path, PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", path).wait_error())
        missing = os.path.join(self.path, "none", "state")
        self.assertIn(missing, PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", missing).wait_error())

    def test_what_is_written_before_a_crash_is_whole(self):
        state = os.path.join(self.path, "state-folder")
        for _ in range(10):
            hub = PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state)
            wait_until(lambda h=hub: os.path.exists(os.path.join(state, "lock")) or h.process.out, "it has begun")
            hub.kill()
        PlainHub(self, "--listen", "tcp://127.0.0.1:0", "--state-dir", state).wait_ready()


class Programs(unittest.TestCase):
    def kill(self, hub, receiver):
        """Until the hub knows: it refuses its name to a newcomer while it takes the connection for a live one."""
        receiver.signal(signal.SIGKILL)
        receiver.wait()
        wait_until(lambda: not any(node["connected"] and node["name"] for node in hub.nodes()), "the node is away")

    def wait_said(self, process, words):
        wait_until(lambda: words in process.err, words)

    def test_a_token_file_that_cannot_be_used_is_named(self):
        hub = Hub(self)
        with tempfile.TemporaryDirectory() as runtime:
            env = {"XDG_RUNTIME_DIR": runtime}
            self.kill(hub, start_recv(self, hub, "cam", env=env))
            tokens = os.path.join(runtime, "gimnet", "tokens")
            path = os.path.join(tokens, os.listdir(tokens)[0])
            with open(path, "w", encoding="utf-8") as file:
                file.write("no token")
            receiver = start_recv(self, hub, "cam", env=env)
            self.wait_said(receiver, f"the token file {path} is not used, and the node may get a new id")
            self.kill(hub, receiver)
            os.chmod(path, 0o644)
            self.wait_said(start_recv(self, hub, "cam", env=env), f"{path} is another user's, open to others, or no file")

    def test_a_folder_is_no_address_of_a_hub(self):
        with tempfile.TemporaryDirectory() as folder:
            said = run_gimnet(f"unix:{folder}", "nodes")
            self.assertNotEqual(said.code, 0)
            self.assertIn(f"it is a folder; name the hub's socket in it, as in unix:{folder}/tcphub.sock", said.err)


if __name__ == "__main__":
    unittest.main()
