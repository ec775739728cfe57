#!/usr/bin/env python3
"""Wrong arguments of tcphub and gimnet: the exit code, and a sentence that says what happened, to what, what to do."""

import json
import os
import socket
import subprocess
import threading
import unittest

from support.processes import GIMNET, TCPHUB, Hub, Process, run_gimnet
from support.waiting import PATIENCE_S
from support.wire import Client


def run(*arguments, env=None):
    process = Process(arguments, env=env)
    try:
        process.code = process.wait()
    finally:
        process.end()
    return process


class WrongForTcphub(unittest.TestCase):
    def refused(self, words, *arguments, code=2):
        hub = run(TCPHUB, *arguments)
        self.assertEqual(hub.code, code, hub.err)
        self.assertTrue(hub.err.startswith("tcphub: "), hub.err)
        for word in words:
            self.assertIn(word, hub.err)
        self.assertEqual(hub.out, b"")

    def test_arguments(self):
        for words, arguments in (
            (["--shards", "0"], ["--shards", "0"]),
            (["--shards", "many"], ["--shards", "many"]),
            (["--hub-id", "4095"], ["--hub-id", "4095"]),
            (["http://127.0.0.1:1", "tcp://"], ["--listen", "http://127.0.0.1:1"]),
            (["tcp://0.0.0.0:0", "--insecure"], ["--listen", "tcp://0.0.0.0:0"]),
            (["frame_byte", "frame_bytes"], ["--limit", "frame_byte=1"]),
            (["--limit"], ["--limit", "frame_bytes"]),
            (["--placement", "hint"], ["--placement", "hnt"]),
            (["--shard", "--shards"], ["--shard", "2"]),
            (["--shards needs a value: threads"], ["--shards"]),
            (["--hub-name needs a value", "'--spin'"], ["--hub-name", "--spin"]),
        ):
            with self.subTest(arguments=arguments):
                self.refused(words, *arguments)

    def test_help_and_version(self):
        for flag in ("--help", "--version", "--help-limits"):
            hub = run(TCPHUB, flag)
            self.assertEqual((hub.code, hub.err), (0, ""), flag)
            self.assertTrue(hub.out, flag)


class WrongForGimnet(unittest.TestCase):
    def refused(self, code, words, *arguments, env=None):
        tool = run(GIMNET, *arguments, env=env)
        self.assertEqual(tool.code, code, tool.err)
        self.assertTrue(tool.err.startswith("gimnet: "), tool.err)
        for word in words:
            self.assertIn(word, tool.err)
        self.assertEqual(tool.out, b"")

    def test_arguments(self):
        for words, arguments in (
            (["sned", "did you mean send?"], ["sned"]),
            (["frobnicate"], ["frobnicate"]),
            (["node"], ["send"]),
            (["--name"], ["recv"]),
            (["--json", "--raw"], ["recv", "--name", "B", "--json", "--raw"]),
            (["odom", "NODE/SERVICE"], ["pub", "odom"]),
            (["robot/odom", "other"], ["pub", "robot/odom", "--name", "other"]),
            (["--delivery"], ["pub", "robot/odom", "--delivery", "sometimes"]),
            (["-c,--count", "0"], ["ping", "B", "-c", "0"]),
            (["--lane"], ["send", "B", "--lane", "fast"]),
            (["--nonsense"], ["nodes", "--nonsense"]),
            (["--name needs a value", "'--raw'"], ["recv", "--name", "--raw"]),
            (["--rate", "'0x10'"], ["pub", "robot/odom", "--rate", "0x10"]),
        ):
            with self.subTest(arguments=arguments):
                self.refused(2, words, *arguments)

    def test_no_command_shows_what_there_is(self):
        self.refused(2, ["the command is missing", "\n  recv "])

    def test_help_begins_with_examples(self):
        for command in ([], ["send"], ["recv"], ["pub"], ["echo"], ["hz"], ["bw"], ["ping"], ["nodes"], ["services"], ["watch"], ["status"],
                        ["impair"]):
            tool = run(GIMNET, *command, "--help")
            self.assertEqual((tool.code, tool.err), (0, ""), command)
            text = tool.out.decode()
            self.assertLess(text.index("Examples:"), text.index("--help"), command)
            self.assertIn(" ".join(["Usage: gimnet", *command]), text)
        version = run(GIMNET, "--version")
        self.assertEqual(version.code, 0)
        self.assertRegex(version.out.decode(), r"^gimnet \d+\.\d+\.\d+\n$")

    def test_no_hub(self):
        self.refused(3, ["tcp://127.0.0.1:1"], "--hub", "tcp://127.0.0.1:1", "nodes")
        self.refused(3, ["tcp://127.0.0.1:1"], "nodes", "--hub", "tcp://127.0.0.1:1")
        self.refused(3, ["tcp://127.0.0.1:1"], "nodes", env={"GIMNET_HUB": "tcp://127.0.0.1:1"})

    def test_wrong_url(self):
        self.refused(2, ["pigeon://roof"], "--hub", "pigeon://roof", "nodes")

    def test_no_such_file(self):
        hub = Hub(self)
        Client(self, hub).join("B")
        tool = run_gimnet(hub, "send", "B", "--file", "/nonexistent/file")
        self.assertEqual(tool.code, 1)
        self.assertIn("/nonexistent/file", tool.err)

    def test_no_such_node(self):
        hub = Hub(self)
        Client(self, hub).join("robot")
        tool = run_gimnet(hub, "send", "robto", data=b"x\n")
        self.assertEqual(tool.code, 4)
        self.assertIn("did you mean robot?", tool.err)

    def test_bad_name(self):
        hub = Hub(self)
        tool = run_gimnet(hub, "recv", "--name", "no spaces")
        self.assertEqual(tool.code, 2)
        self.assertIn("no spaces", tool.err)
        tool = run_gimnet(hub, "recv", "--name", "7.1")
        self.assertEqual(tool.code, 2)
        self.assertIn("'7.1': it reads as the id of a node does, NUMBER.NUMBER", tool.err)

    def test_a_pattern_that_is_too_long(self):
        hub = Hub(self)
        for pattern, why in (("*/" * 16 + "*", "it has more than 16 parts"), ("x" * 256, "it has more than 255 bytes")):
            tool = run_gimnet(hub, "services", pattern)
            self.assertEqual(tool.code, 2)
            self.assertIn(f"cannot look for '{pattern}': {why}", tool.err)

    def test_a_reader_of_the_output_that_went_away_had_enough(self):
        hub = Hub(self)
        reader, writer = os.pipe()
        os.close(reader)
        with subprocess.Popen([GIMNET, "--hub", hub.url, "status"], stdout=writer, stderr=subprocess.PIPE) as tool:
            os.close(writer)
            _, words = tool.communicate(timeout=PATIENCE_S)
        self.assertEqual((tool.returncode, words), (0, b""))

    def test_an_output_that_is_full(self):
        hub = Hub(self)
        for words in (["status"], ["--help"]):
            with open("/dev/full", "wb") as full, subprocess.Popen([GIMNET, "--hub", hub.url, *words], stdout=full,
                                                                   stderr=subprocess.PIPE) as tool:
                _, said = tool.communicate(timeout=PATIENCE_S)
            self.assertEqual((tool.returncode, said), (1, b"gimnet: cannot write to standard output: No space left on device\n"))

    def test_another_version(self):
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)

        def answer():
            with listener.accept()[0] as peer:
                peer.recv(4096)
                body = bytes([3 << 3, 1, 0, 0, 2, 1, 0])
                goodbye = b"\x03\0\0\0" + body
                peer.sendall(b"GIMnet\x02\x00" + len(goodbye).to_bytes(4, "little") + bytes(8) + b"\x10\0\0\1" + goodbye)
                peer.recv(4096)
        thread = threading.Thread(target=answer)
        thread.start()
        self.refused(7, ["version"], "--hub", f"tcp://127.0.0.1:{listener.getsockname()[1]}", "nodes")
        thread.join()

    def test_json_before_or_after_the_command(self):
        hub = Hub(self)
        for words in (("--json", "status"), ("status", "--json")):
            status = json.loads(run_gimnet(hub, *words).out)
            self.assertEqual(status["hub"]["id"], 7)
            self.assertEqual(status["connections"][0]["shard"], 0)
            self.assertIn("mailbox_wakeups", status["counters"])
            self.assertIn("dropped.queue_full", status["shards"][0]["counters"])


if __name__ == "__main__":
    unittest.main()
