#!/usr/bin/env python3
"""A hub is configured and administered while it runs: gimnet ctl, SIGHUP, configuration files. Real processes."""

import json
import os
import pathlib
import resource
import signal
import tempfile
import unittest

from support.processes import GIMNET, TCPHUB, Hub, Process, run_gimnet, start_recv
from support.tap import Tap
from support.waiting import wait_until
from support.wire import CTRL, OPENING, Client, hello


class Case(unittest.TestCase):
    def hub(self, *arguments, **how):
        hub = Hub(self, *arguments, **how)
        self.admin = f"unix:{hub.socket_path}"
        return hub

    def ctl(self, *words, url=None):
        process = Process([GIMNET, "--hub", url or self.admin, "ctl", *words])
        self.addCleanup(process.end)
        process.code = process.wait()
        return process

    def id_of(self, hub, name):
        return next((node["id"] for node in hub.nodes() if node["name"] == name), None)


class Full(Case):
    """A hub that takes nobody any more: who administers it gets in all the same."""

    def sees_and_kicks(self, node):
        for words in (["status"], ["nodes"], ["services"], ["ctl", "connections"], ["hubs"], ["links"],
                      ["graph"], ["status", "--all"]):
            look = run_gimnet(self.admin, *words)
            self.assertEqual(look.code, 0, (words, look.err))
        kicked = self.ctl("kick", f"{node.id >> 20}.{node.id & 0xFFFFF}")
        self.assertEqual(kicked.code, 0, kicked.err)
        self.assertEqual(node.goodbye(), "kicked")
        node.socket.close()

    def test_at_the_limit_on_nodes(self):
        hub = self.hub("--limit", "nodes=2", "--limit", "silent_ms=600000")
        nodes = [Client(self, hub).join(name) for name in ("A", "B")]
        refused = run_gimnet(hub, "status")
        self.assertEqual(refused.code, 3, refused.err)
        self.assertIn("as many nodes as it takes (2); connect to another one, or start it with a larger --limit nodes", refused.err)
        self.sees_and_kicks(nodes[0])
        Client(self, hub).join("C")

    def test_without_descriptors(self):
        hub = self.hub("--limit", "silent_ms=600000", "--limit", "handshake_ms=600000", "--limit", "administrators=2")
        silent = Client(self, hub)
        pid = hub.process.popen.pid
        wait_until(lambda: run_gimnet(hub, "status").code == 0, "a hub that serves")
        hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)[1]
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (len(os.listdir(f"/proc/{pid}/fd")) + 4, hard))
        nodes = []

        def come():
            client = Client(self, hub)
            client.send(OPENING + hello())
            answer = client.first_answer()
            if answer.goodbye is None:
                client.id = answer.dst
                nodes.append(client)
            return answer.goodbye
        wait_until(lambda: come() == "no_memory", "no descriptor left")
        self.assertEqual(silent.first_answer().goodbye, "no_memory", "who says no HELLO makes way first")
        refused = run_gimnet(hub, "status")
        self.assertEqual(refused.code, 3, refused.err)
        self.assertIn("out of descriptors", refused.err)
        self.sees_and_kicks(nodes.pop(0))
        wait_until(lambda: come() is None, "room for another")
        self.assertGreaterEqual(json.loads(run_gimnet(self.admin, "status", "--json").out)["counters"]
                                ["refused.no_descriptor"], 2)


class Ctl(Case):
    def test_a_kicked_node_is_told_why_and_does_not_come_back(self):
        hub = self.hub()
        receiver = start_recv(self, hub, "B")
        former = self.id_of(hub, "B")
        self.assertEqual(self.ctl("kick", "B", "--reason", "it stands in the way").code, 0)
        self.assertEqual(receiver.wait(), 3, "nobody waits for what cannot come any more")
        self.assertIn("it stands in the way", receiver.err)
        self.assertIsNone(self.id_of(hub, "B"))
        # The name is free, and the token that the first one left counts as none.
        start_recv(self, hub, "B")
        self.assertNotEqual(self.id_of(hub, "B"), former)

    def test_a_reason_that_is_too_long_is_refused_and_nobody_kicked(self):
        hub = self.hub()
        receiver = start_recv(self, hub, "B")
        refused = self.ctl("kick", "B", "--reason", "y" * 257)
        self.assertEqual(refused.code, 2, refused.err)
        self.assertIn("the reason has 257 bytes, and 256 are the most", refused.err)
        self.assertIsNotNone(self.id_of(hub, "B"))
        self.assertEqual(self.ctl("kick", "B", "--reason", "y" * 256).code, 0)
        self.assertEqual(receiver.wait(), 3)
        self.assertIn(": " + "y" * 256 + ";", receiver.err)

    def test_a_node_goes_on_under_another_id(self):
        hub = self.hub()
        receiving, sending, lost = (Tap(self, hub) for _ in range(3))
        receiver = start_recv(self, receiving, "B", "-n", "2")
        former = self.id_of(hub, "B")
        self.assertEqual(run_gimnet(sending, "send", "B", data=b"one\n").code, 0)
        # What it has not confirmed by then would count as lost.
        hub.expect_ledger(self, accepted=lambda: receiving.sent() + sending.sent(),
                          delivered=lambda: receiving.got() + sending.got(), dropped={})
        self.assertEqual(self.ctl("reassign", "B", "7.500").code, 0)
        wait_until(lambda: any(node["id"] == "7.500" and node["connected"] for node in hub.nodes()), "B as 7.500")
        self.assertEqual(self.id_of(hub, "B"), "7.500")
        old = run_gimnet(lost, "send", former, data=b"lost\n")
        self.assertEqual(old.code, 1)
        self.assertIn("renumbered", old.err)
        self.assertEqual(run_gimnet(sending, "send", "7.500", data=b"two\n").code, 0)
        self.assertEqual((receiver.wait(), receiver.out), (0, b"one\ntwo\n"))
        hub.expect_ledger(self, accepted=lambda: receiving.sent() + sending.sent() + lost.sent(),
                          delivered=lambda: receiving.got() + sending.got(), dropped={"renumbered": lost.sent})

    def test_where_the_state_cannot_be_written_no_id_is_given_and_a_kick_says_what_it_cannot_promise(self):
        hub = self.hub()
        receiver = start_recv(self, hub, "B")
        before = self.id_of(hub, "B")
        in_the_way = pathlib.Path(hub.state, "state.new")
        in_the_way.mkdir()  # whoever runs the test
        refused = self.ctl("reassign", "B", "7.900000")
        self.assertEqual(refused.code, 1, refused.err)
        for part in ("7.900000", "cannot write the hub's state", "try again"):
            self.assertIn(part, refused.err)
        self.assertEqual(self.id_of(hub, "B"), before)
        in_the_way.rmdir()
        self.assertEqual(self.ctl("reassign", "B", "7.900000").code, 0)
        wait_until(lambda: any(node["id"] == "7.900000" and node["connected"] for node in hub.nodes()), "B as 7.900000")
        in_the_way.mkdir()
        kicked = self.ctl("kick", "B")
        self.assertEqual((kicked.code, kicked.out), (0, b"kicked 7.900000\n"))
        self.assertIn("cannot write the hub's state", kicked.err)
        self.assertEqual(receiver.wait(), 3)
        in_the_way.rmdir()
        start_recv(self, hub, "B")
        self.assertEqual(self.ctl("kick", "B").err, "")

    def test_only_administrators_change_and_everybody_reads(self):
        hub = self.hub()
        start_recv(self, hub, "B")
        for words in (("kick", "B"), ("reassign", "B", "7.9"), ("drain",), ("reload",), ("log", "debug")):
            denied = self.ctl(*words, url=hub.url)
            self.assertEqual(denied.code, 6, denied.err)
            self.assertIn("--hub unix:", denied.err)
        self.assertIsNotNone(self.id_of(hub, "B"))
        connections = json.loads(self.ctl("connections", "--json", url=hub.url).out)
        self.assertIn("B", [connection["name"] for connection in connections])
        self.assertIn(b"TRANSPORT", self.ctl("connections", url=hub.url).out)

    def test_each_mistake_has_its_words_and_its_exit_code(self):
        hub = self.hub()
        start_recv(self, hub, "B")
        start_recv(self, hub, "D")
        held = self.id_of(hub, "D")
        for code, part, words in ((4, "there is no node 'C'", ("kick", "C")), (4, "7.99", ("kick", "7.99")),
                                  (2, "is no id", ("reassign", "B", "x")), (1, "another node", ("reassign", "B", held)),
                                  (2, "did you mean debug?", ("log", "debgu")),
                                  (2, "add, remove or cost", ("link", "ad", "unix:/a")),
                                  (2, "cost is missing", ("link", "cost", "lab"))):
            refused = self.ctl(*words)
            self.assertEqual(refused.code, code, (words, refused.err))
            self.assertIn(part, refused.err)
        self.assertEqual(self.ctl().code, 2)
        self.assertEqual(self.ctl("kick").code, 2)

    def test_drain_ends_the_hub_as_sigterm_does(self):
        hub = self.hub()
        start_recv(self, hub, "B")
        self.assertEqual(self.ctl("drain").code, 0)
        self.assertEqual(hub.process.wait(), 0)
        self.assertIn("draining, asked for by", hub.process.err)

    def test_the_log_level_changes_at_once(self):
        hub = self.hub("--log-level", "error")
        start_recv(self, hub, "B")
        self.assertEqual(hub.process.err.count("joined"), 0)
        self.assertIn(b"before error", self.ctl("log", "info").out)
        start_recv(self, hub, "C")
        wait_until(lambda: "'C' joined" in hub.process.err, "the line about C")


class Reload(Case):
    def configured(self, text):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-config-")
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name, "hub.toml")
        self.file.write_text(text)
        return self.hub("--config", str(self.file))

    def test_what_may_change_changes_and_the_rest_is_named(self):
        hub = self.configured("[limits]\nservices_per_node = 10\n")
        self.file.write_text("log_level = 'debug'\nplacement = 'spread'\n"
                             "[limits]\nservices_per_node = 0\nframe_bytes = 70000\n")
        reloaded = self.ctl("reload")
        self.assertEqual(reloaded.code, 0, reloaded.err)
        lines = reloaded.out.decode().splitlines()
        self.assertIn("limits.services_per_node: 10 -> 0", lines)
        self.assertIn("limits.frame_bytes: 65536 -> 70000 (needs a restart)", lines)
        self.assertIn('log_level: "info" -> "debug"', lines)
        self.assertFalse([line for line in lines if line.startswith("placement")], "a flag is stronger than the file")
        refused = run_gimnet(hub, "pub", "robot/odom", data=b"x\n")
        self.assertEqual(refused.code, 1)
        self.assertIn("services_per_node", refused.err)

    def test_a_bad_file_changes_nothing(self):
        hub = self.configured("[limits]\nservices_per_node = 0\n")
        self.file.write_text("shrads = 2\nspni = true\n[limits]\nservices_per_node = 5\n")
        refused = self.ctl("reload")
        self.assertEqual(refused.code, 1)
        self.assertIn(f"\n{self.file}:1:1: there is no key 'shrads'", refused.err)
        self.assertIn(f"\n{self.file}:2:1: there is no key 'spni'", refused.err)
        self.assertIn("stays in force", refused.err)
        wait_until(lambda: "there is no key 'shrads'" in hub.process.err, "the same words in the log")
        self.assertEqual(run_gimnet(hub, "pub", "robot/odom", data=b"x\n").code, 1)
        self.file.unlink()
        self.assertEqual(self.ctl("reload").code, 1)
        self.assertEqual(run_gimnet(hub, "pub", "robot/odom", data=b"x\n").code, 1)

    def test_of_many_faults_whole_ones_are_told_and_how_many_there_are(self):
        hub = self.configured("")
        self.file.write_text("".join(f"k{i} = 1\n" for i in range(60)))
        refused = self.ctl("reload")
        self.assertEqual(refused.code, 1)
        lines = refused.err.rstrip("\n").split("\n")
        self.assertTrue(all(line.startswith(f"{self.file}:") and line.endswith("shows all)") for line in lines[1:-1]))
        self.assertEqual(lines[-1], f"and {62 - len(lines)} more faults: the hub's log tells all of them, and so does "
                                    "tcphub --check-config")
        wait_until(lambda: hub.process.err.count("there is no key 'k") == 60, "each of them in the log")

    def test_what_is_no_file_is_refused_and_stops_nobody(self):
        hub = self.configured("[limits]\nservices_per_node = 0\n")
        self.file.unlink()
        os.mkfifo(self.file)
        refused = self.ctl("reload")
        self.assertEqual(refused.code, 1)
        self.assertIn(f"{self.file}: cannot read this file: it is a pipe", refused.err)
        hub.process.signal(signal.SIGHUP)
        wait_until(lambda: hub.process.err.count("it is a pipe") == 2, "the refusals in the log")
        self.assertEqual(run_gimnet(hub, "pub", "robot/odom", data=b"x\n").code, 1, "the stricter policy rules still")

    def test_without_descriptors_it_says_so_and_changes_nothing(self):
        hub = self.configured("[limits]\nservices_per_node = 10\n")
        more = self.file.parent / "conf.d"
        more.mkdir()
        (more / "strict.toml").write_text("[limits]\nservices_per_node = 0\n")
        self.assertEqual(self.ctl("reload").code, 0)
        self.file.write_text("[limits]\nservices_per_node = 5\nsubscriptions_per_node = 5\n")
        admin = Client(self, hub, local=True).join(role=2)
        pid = hub.process.popen.pid
        soft, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (3, hard))
        answer = admin.ask(CTRL, 7)
        self.assertEqual(answer[1], 2)
        for words in ("stays in force", f"{self.file}: cannot read this file: Too many open files", "(ulimit -n)"):
            self.assertIn(words, answer[2])
        hub.process.signal(signal.SIGHUP)
        wait_until(lambda: hub.process.err.count("the former one stays in force") == 2, "the refusals in the log")
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (soft, hard))
        self.assertEqual(run_gimnet(hub, "pub", "robot/odom", data=b"x\n").code, 1, "the stricter file rules still")
        reloaded = self.ctl("reload")
        self.assertEqual(reloaded.code, 0, reloaded.err)
        self.assertEqual(reloaded.out.decode().splitlines(), ["limits.subscriptions_per_node: 1024 -> 5"])

    def test_sighup_reads_it_again(self):
        hub = self.configured("[limits]\nservices_per_node = 10\n")
        receiver = start_recv(self, hub, "B", "-n", "1")
        self.file.write_text("[limits]\nservices_per_node = 0\n")
        hub.process.signal(signal.SIGHUP)
        wait_until(lambda: "changed limits.services_per_node from 10 to 0" in hub.process.err, "the reload in the log")
        self.file.write_text("=\n")
        hub.process.signal(signal.SIGHUP)
        wait_until(lambda: "stays in force" in hub.process.err, "the refusal in the log")
        self.assertEqual(run_gimnet(hub, "pub", "robot/odom", data=b"x\n").code, 1)
        tap = Tap(self, hub)
        self.assertEqual(run_gimnet(tap, "send", "B", data=b"still here\n").code, 0)
        self.assertEqual((receiver.wait(), receiver.out), (0, b"still here\n"))
        hub.expect_ledger(self, accepted=lambda: tap.sent() + tap.got(), delivered=lambda: tap.sent() + tap.got())


class Start(unittest.TestCase):
    def run_hub(self, *arguments, env=None):
        process = Process([TCPHUB, *arguments], env=env)
        self.addCleanup(process.end)
        process.code = process.wait()
        return process

    def test_a_wrong_file_is_told_line_by_line_and_nothing_starts(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "hub.toml")
            pathlib.Path(path).write_text("shards = '2'\n\n[limits]\ngrace_ms = '30s'\n  nods = 3\n")
            for arguments in (("--check-config", "--config", path), ("--config", path)):
                refused = self.run_hub(*arguments)
                self.assertEqual((refused.code, refused.out), (2, b""))
                places = [":".join(line.split(":")[1:3]) for line in refused.err.splitlines()]
                self.assertEqual(places, ["1:10", "4:12", "5:3"])

    def test_every_source_is_shown_with_what_came_from_it(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "hub.toml")
            path.write_text("shards = 1\nhub_id = 3\n")
            pathlib.Path(folder, "conf.d").mkdir()
            pathlib.Path(folder, "conf.d", "10.toml").write_text("hub_id = 4\nhub_name = 'hall'\n")
            shown = self.run_hub("--print-config", "--config", str(path), "--hub-name", "yard",
                                 env={"TCPHUB_LIMITS_NODES": "9"}).out.decode().splitlines()
            for line in (f"shards = 1  # {path}:1", f"hub_id = 4  # {folder}/conf.d/10.toml:1",
                         'hub_name = "yard"  # flag --hub-name', "nodes = 9  # environment TCPHUB_LIMITS_NODES",
                         "insecure = false  # default"):
                self.assertIn(line, shown)


if __name__ == "__main__":
    unittest.main()
