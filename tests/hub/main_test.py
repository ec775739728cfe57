"""tcphub as a program: its command line, its one line of output, its exit codes and what it does at signals."""

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

TCPHUB = sys.argv.pop(1)
PATIENCE_S = 20
# What hubs keep belongs to the test, not to the user who runs it.
STATE_HOME = tempfile.TemporaryDirectory(prefix="gimnet-test-state-")
ENVIRONMENT = {**os.environ, "XDG_STATE_HOME": STATE_HOME.name}
ENVIRONMENT.pop("STATE_DIRECTORY", None)


class Hub:
    """A running tcphub; ends with the `with` block."""

    def __init__(self, *arguments, **environment):
        self.process = subprocess.Popen([TCPHUB, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                        text=True, env={**ENVIRONMENT, **environment})
        self.ready = self.process.stdout.readline().strip()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait(PATIENCE_S)
        self.process.stdout.close()
        self.process.stderr.close()

    def end(self, number):
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


def run(*arguments, **environment):
    return subprocess.run([TCPHUB, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False,
                          env={**ENVIRONMENT, **environment})


class CommandLine(unittest.TestCase):
    def test_says_where_it_listens_in_one_line(self):
        with tempfile.TemporaryDirectory() as folder:
            with Hub("--listen", "tcp://127.0.0.1:0", "--listen", f"unix:{folder}/s", "--shards", "2", "--hub-id", "7",
                     "--state-dir", f"{folder}/state") as hub:
                self.assertRegex(hub.ready, rf"^ready tcp://127\.0\.0\.1:[1-9]\d* unix:{folder}/s$")
                self.assertEqual(os.stat(f"{folder}/state").st_mode & 0o777, 0o700)
                self.assertEqual(hub.end(signal.SIGTERM), 0)
                self.assertEqual(hub.process.stdout.read(), "")
                self.assertFalse(os.path.exists(f"{folder}/s"))

    def test_says_which_address_other_machines_can_reach(self):
        with Hub("--listen", "tcp://127.0.0.1:0", "--listen", "tcp://0.0.0.0:0", "--insecure") as hub:
            self.assertEqual(hub.end(signal.SIGTERM), 0)
            said = hub.process.stderr.read()
        self.assertEqual(said.count("nothing is encrypted"), 1, said)
        self.assertRegex(said, r"listening on tcp://0\.0\.0\.0:\d+: other machines can reach it, nothing is encrypted")
        with Hub("--listen", "tcp://127.0.0.1:0", "--insecure") as hub:
            self.assertEqual(hub.end(signal.SIGTERM), 0)
            self.assertNotIn("encrypted", hub.process.stderr.read())

    def test_both_signals_end_it_well(self):
        with Hub("--listen", "tcp://127.0.0.1:0") as hub:
            self.assertEqual(hub.end(signal.SIGINT), 0)

    def test_a_port_left_by_kill_can_be_bound_at_once(self):
        with tempfile.TemporaryDirectory() as folder:
            path = f"unix:{folder}/s"
            with Hub("--listen", "tcp://127.0.0.1:0", "--listen", path) as first:
                url = first.ready.split()[1]
                with socket.create_connection(("127.0.0.1", int(url.rsplit(":", 1)[1]))):
                    self.assertEqual(first.end(signal.SIGKILL), -signal.SIGKILL)
                    with Hub("--listen", url, "--listen", path) as second:
                        self.assertEqual(second.ready, f"ready {url} {path}")

    def test_a_busy_port_is_named_with_its_owner(self):
        with Hub("--listen", "tcp://127.0.0.1:0") as hub:
            url = hub.ready.split()[1]
            refused = run("--listen", url)
            self.assertEqual(refused.returncode, 1)
            self.assertEqual(refused.stdout, "")
            self.assertIn(f"cannot listen on {url}", refused.stderr)
            self.assertIn(f"tcphub (process {hub.process.pid})", refused.stderr)

    def test_without_listen_the_socket_is_in_the_runtime_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            with Hub(XDG_RUNTIME_DIR=folder) as hub:
                if not hub.ready:
                    self.skipTest("the default port is in use on this machine: " + hub.process.stderr.read())
                self.assertEqual(hub.ready, f"ready tcp://127.0.0.1:7450 unix:{folder}/gimnet/tcphub.sock")

    def expect_tcp_only(self, folder, why):
        with Hub(XDG_RUNTIME_DIR=folder) as hub:
            if not hub.ready:
                said = hub.process.stderr.read()
                self.assertIn("cannot listen on tcp://127.0.0.1:7450", said)
                self.skipTest("the default port is in use on this machine: " + said)
            self.assertEqual(hub.ready, "ready tcp://127.0.0.1:7450")
            self.assertEqual(hub.end(signal.SIGTERM), 0)
            said = hub.process.stderr.read()
            for part in ("listening on TCP only", why, "--listen unix:/PATH"):
                self.assertIn(part, said)

    def test_a_runtime_folder_that_is_gone_costs_the_socket_only(self):
        with tempfile.TemporaryDirectory() as folder:
            self.expect_tcp_only(f"{folder}/gone", f"make {folder}/gone first")

    def test_a_runtime_folder_that_cannot_be_used_costs_the_socket_only(self):
        for mode, owner, why in ((0o755, None, "other users have rights in it"),
                                 (0o500, None, "nothing can be put into it"),
                                 (0o700, 12_345, "it belongs to another user")):
            with self.subTest(why=why), tempfile.TemporaryDirectory() as folder:
                if (mode == 0o500 and os.geteuid() == 0) or (owner and os.geteuid() != 0):
                    self.skipTest("not with the rights of this user")
                os.mkdir(f"{folder}/gimnet")
                os.chmod(f"{folder}/gimnet", mode)
                if owner:
                    os.chown(f"{folder}/gimnet", owner, owner)
                self.expect_tcp_only(folder, why)
                self.assertEqual(os.listdir(f"{folder}/gimnet"), [])

    def test_a_wrong_command_line_is_told_and_ends_with_2(self):
        for arguments, part in ((("--lisen", "x"), "did you mean --listen?"),
                                (("--limit", "nodes=0"), "nodes"),
                                (("--listen", "tcp://0.0.0.0:0"), "trusted give --insecure"),
                                (("--shards", "many"), "--shards")):
            refused = run(*arguments)
            self.assertEqual(refused.returncode, 2, arguments)
            self.assertIn(part, refused.stderr)
            self.assertEqual(refused.stdout, "")
            self.assertEqual(refused.stderr.count("\n"), 1, refused.stderr)

    def test_version_and_limits_are_told(self):
        self.assertTrue(re.match(r"tcphub \d+\.\d+", run("--version").stdout))
        self.assertIn("control_bytes", run("--help-limits").stdout)
        self.assertEqual(run("--help").returncode, 0)


if __name__ == "__main__":
    unittest.main()
