#!/usr/bin/env python3
"""Every path by which a person meets an error of `gimnet`: what happened, to what, what to do, and the exit code. The
tables are the test; {port}, {folder} and {robot} stand for those of the run."""

import json
import os
import pathlib
import socket
import subprocess
import tempfile
import threading
import unittest

from support.processes import GIMNET, HOME, Hub, Process, run_gimnet, start_gimnet, start_recv
from support.waiting import PATIENCE_S, wait_until
from support.wire import Client

FAILED, USAGE, NO_CONNECTION, NOT_FOUND, TIMEOUT, DENIED, BAD_VERSION = range(1, 8)
HOW = "--help` shows how it is called."
LIST = "lists those that are there"
URL_FORMS = "give tcp://host:port or unix:/path"
NAME_RULE = "it has a character other than A-Z a-z 0-9 . _ - and /"
PATTERN_RULE = "it is not a pattern: parts are separated by one /"

# Command line: exit code, words of the error, arguments.
WRONG_WORDS = [
    (USAGE, ["the command is missing; these are there:", "`gimnet --help` shows"], []),
    (USAGE, ["--hub is given 2 times: give it once"], ["--hub", "tcp://a:1", "--hub", "tcp://b:1", "nodes"]),
    (USAGE, ["'nodes' is one word too many for gimnet status"], ["status", "nodes"]),
    (USAGE, ["there is no command 'sned'; did you mean send?", "`gimnet " + HOW], ["sned", "B"]),
    (USAGE, ["there is no command 'frobnicate'", "`gimnet " + HOW], ["frobnicate"]),
    (USAGE, ["there is no option --al for gimnet nodes; did you mean --all?", "`gimnet nodes " + HOW], ["nodes", "--al"]),
    (USAGE, ["there is no option --nope for gimnet"], ["--nope"]),
    (USAGE, ["'more' is one word too many for gimnet status"], ["status", "more"]),
    (USAGE, ["node is missing: name or id of the receiver", "`gimnet send " + HOW], ["send"]),
    (USAGE, ["--name is missing: name of this node, to which others send"], ["recv"]),
    (USAGE, ["service is missing: full name, node/service, or a pattern"], ["hz"]),
    (USAGE, ["--file needs a value: send this file as one message"], ["send", "B", "--file"]),
    (USAGE, ["--hub needs a value: tcp://host:port or unix:/path"], ["nodes", "--hub"]),
    (USAGE, ["--name needs a value: name of this node"], ["recv", "--name", ""]),
    (USAGE, ["node needs a value: name or id"], ["ping", ""]),
    (USAGE, ["'10Hz' is no value for --rate: lines a second, 0.001 to 1000000"], ["pub", "a/b", "--rate", "10Hz"]),
    (USAGE, ["'10ms' is no value for -W,--timeout: seconds", "0.001 to 3600"], ["ping", "B", "-W", "10ms"]),
    (USAGE, ["'64MB' is no value for --max-size: largest message taken, in bytes"],
     ["recv", "--name", "B", "--max-size", "64MB"]),
    (USAGE, ["'0' is no value for -c,--count: how many, 1 to 1000000000"], ["ping", "B", "-c", "0"]),
    (USAGE, ["'0' is no value for -n,--count: end after that many messages or events, 1 or more"], ["echo", "a/b", "-n", "0"]),
    (USAGE, ["'2min' is no value for --seconds: end after that many seconds"], ["bw", "a/b", "--seconds", "2min"]),
    (USAGE, ["'1s' is no value for --window: seconds"], ["hz", "a/b", "--window", "1s"]),
    (USAGE, ["'-1' is no value for --type: message type, a whole number up to 4294967295"], ["send", "B", "--type", "-1"]),
    (USAGE, ["'fast' is no value for --lane: real_time, normal, bulk or background"], ["send", "B", "--lane", "fast"]),
    (USAGE, ["'sometimes' is no value for --delivery: stream", "latest"], ["pub", "a/b", "--delivery", "sometimes"]),
    (USAGE, ["'red' is no value for --color: auto"], ["nodes", "--color", "red"]),
    (USAGE, ["--json and --raw contradict each other: give one of them"], ["echo", "a/b", "--json", "--raw"]),
    (USAGE, ["'odom' is no full name of a service: write NODE/SERVICE"], ["pub", "odom"]),
    (USAGE, ["'odom' is no full name of a service: write NODE/SERVICE"], ["echo", "odom"]),
    (USAGE, ["robot/odom belongs to the node robot, not to other: leave --name out"],
     ["pub", "robot/odom", "--name", "other"]),
]

# No hub there: exit code, words, --hub.
WRONG_HUBS = [
    (USAGE, ["--hub needs a value"], ""),
    (USAGE, ["'localhost': the scheme is unknown", URL_FORMS + ", such as tcp://localhost:7450"], "localhost"),
    (USAGE, ["'/run/hub.sock': the scheme is unknown; did you mean unix:/run/hub.sock?"], "/run/hub.sock"),
    (USAGE, ["did you mean tcp://localhost:7450?"], "localhost:7450"),
    (USAGE, ["'http://127.0.0.1:7450': the scheme is unknown", URL_FORMS], "http://127.0.0.1:7450"),
    (USAGE, ["'tcp://': the port is missing", URL_FORMS], "tcp://"),
    (USAGE, ["'tcp://127.0.0.1': the port is missing", ", such as tcp://127.0.0.1:7450"], "tcp://127.0.0.1"),
    (USAGE, ["'tcp://:7450': the host is missing"], "tcp://:7450"),
    (USAGE, ["the port is not a number from 1 to 65535"], "tcp://127.0.0.1:port"),
    (USAGE, ["the port is not a number from 1 to 65535"], "tcp://127.0.0.1:0"),
    (USAGE, ["the port is not a number from 1 to 65535"], "tcp://127.0.0.1:65536"),
    (USAGE, ["an IPv6 address stands between [ and ]"], "tcp://[::1:7450"),
    (USAGE, ["'unix:': the path is missing"], "unix:"),
    (USAGE, ["the path is too long for a Unix socket"], "unix:/" + "x" * 108),
    (NO_CONNECTION, ["cannot find the host of tcp://no.such.host.invalid:7450: ", ". Look at its name, or name another with --hub"],
     "tcp://no.such.host.invalid:7450"),
    (NO_CONNECTION, ["cannot connect to tcp://127.0.0.1:{port}: Connection refused", "there? Start one there with `tcphub`",
                     "--hub"], "tcp://127.0.0.1:{port}"),
    (NO_CONNECTION, ["cannot connect to unix:{folder}/none: No such file", "tcphub"], "unix:{folder}/none"),
    (NO_CONNECTION, ["cannot connect to unix:{folder}/text: Connection refused"], "unix:{folder}/text"),
]

# For nodes of the test, which keep alive only when they are told to: on a slow machine the hub would end them.
NOBODY_IS_SILENT = ("--limit", "silent_ms=600000")

# A hub with the nodes `robot` (takes at most 100,000 bytes a message) and `mute` (does nothing) and the service
# robot2/odom: exit code, words, arguments, standard input.
WITH_A_HUB = [
    (DENIED, ["the name 'robot' is held by node {robot}, connected over tcp from 127.0.0.1", "end that one, or choose another"],
     ["recv", "--name", "robot"], b""),
    (DENIED, ["the name 'robot' is held by node {robot}"], ["pub", "robot/odom"], b"x\n"),
    (USAGE, ["'no spaces'", NAME_RULE], ["recv", "--name", "no spaces"], b""),
    (USAGE, ["it has more than 255 bytes"], ["recv", "--name", "x" * 256], b""),
    (USAGE, ["it has an empty part: between two parts stands one /"], ["pub", "a//b"], b"x\n"),
    (USAGE, ["cannot look for 'a//b'", PATTERN_RULE], ["nodes", "a//b"], b""),
    (USAGE, ["cannot look for '***'", PATTERN_RULE], ["services", "***"], b""),
    (USAGE, ["cannot look for '*/'", PATTERN_RULE], ["echo", "*/"], b""),
    (USAGE, ["cannot subscribe to 'a/b c'", NAME_RULE], ["hz", "a/b c"], b""),
    (NOT_FOUND, ["there is no node 'robto'; did you mean robot?"], ["send", "robto"], b"x\n"),
    (NOT_FOUND, ["there is no node 'nobody'", LIST], ["ping", "nobody"], b""),
    (NOT_FOUND, ["there is no node '7.x'", LIST], ["send", "7.x"], b"x\n"),
    (NOT_FOUND, ["there is no node '99'; the id is written 7.99; `gimnet nodes` lists"], ["send", "99"], b"x\n"),
    (NOT_FOUND, ["there is no node '9999.1'", LIST], ["send", "9999.1"], b"x\n"),
    (NOT_FOUND, ["not acknowledged by 7.999", "no_such_node: no node has that id"], ["send", "7.999"], b"x\n"),
    (NOT_FOUND, ["not acknowledged by 8.1", "no_route: no hub of that id can be reached"], ["send", "8.1"], b"x\n"),
    (NOT_FOUND, ["7.999 cannot be reached: ", "no_such_node: no node has that id"], ["ping", "7.999", "-c", "1"], b""),
    (USAGE, ["7.1048575 cannot be pinged: this id means all nodes"], ["ping", "7.1048575"], b""),
    (NOT_FOUND, ["no node matches 'robto'; did you mean robot?"], ["nodes", "robto"], b""),
    (NOT_FOUND, ["no service matches 'robot2/odm'; did you mean robot2/odom?"], ["services", "robot2/odm"], b""),
    (NOT_FOUND, ["no service matches 'x/*'", LIST], ["services", "x/*"], b""),
    (NOT_FOUND, ["no service matches 'robot2'; did you mean 'robot2/**'?"], ["services", "robot2"], b""),
    (NOT_FOUND, ["there is no node 'robot2/odom': that is a service of the node robot2"], ["ping", "robot2/odom"], b""),
    (TIMEOUT, ["mute answered none of 1 pings"], ["ping", "mute", "-c", "1", "-W", "0.01"], b""),
    (TIMEOUT, ["nobody provides a/b yet; waiting for it", "waited 0.05 s for a message of a/b: none came"],
     ["echo", "a/b", "--seconds", "0.05"], b""),
    (TIMEOUT, ["waited 0.05 s for 3 messages of a/*: none came"], ["hz", "a/*", "--seconds", "0.05", "-n", "3"], b""),
    (FAILED, ["cannot read {folder}/none: No such file"], ["send", "robot", "--file", "{folder}/none"], b""),
    (FAILED, ["cannot read {folder}: Is a directory"], ["send", "robot", "--file", "{folder}"], b""),
    (FAILED, ["cannot send {folder}/huge: it is larger than a message can be, 1073741824 bytes; send it in parts"],
     ["send", "robot", "--file", "{folder}/huge"], b""),
    (FAILED, ["cannot send to robot: the receiver refused the message: it is larger than it takes"],
     ["send", "robot", "--file", "{folder}/large"], b""),
]


class Tool(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        self.addCleanup(folder.cleanup)
        with socket.create_server(("127.0.0.1", 0)) as closed:
            self.places = {"folder": folder.name, "port": closed.getsockname()[1]}
        for name, size in (("text", 5), ("large", 2 << 20), ("huge", (1 << 30) + 1)):
            with open(os.path.join(folder.name, name), "wb") as file:
                file.truncate(size)

    def filled(self, word):
        return word.format(**self.places) if "{" in word else word

    def run_tool(self, arguments, stdin=b"", env=None, stdout=subprocess.PIPE):
        environment = {key: text for key, text in os.environ.items() if key != "GIMNET_HUB"} | (env or {})
        tool = subprocess.run([GIMNET, *map(self.filled, arguments)], input=stdin, stdout=stdout, stderr=subprocess.PIPE,
                              env=environment, timeout=2 * PATIENCE_S, check=False)
        return tool.returncode, tool.stderr.decode()

    def expect(self, code, words, arguments, **how):
        with self.subTest(arguments=arguments):
            ended, said = self.run_tool(arguments, **how)
            self.assertEqual(ended, code, said)
            for word in map(self.filled, words):
                self.assertIn(word, said)
            for line in said.splitlines():
                self.assertLessEqual(line.count("cannot "), 1, "says it twice: " + line)
                self.assertNotIn("nif_", line, "speaks of the library to a person")


class Errors(Tool):
    def test_wrong_words(self):
        for code, words, arguments in WRONG_WORDS:
            self.expect(code, words, arguments)

    def test_wrong_hubs(self):
        for code, words, url in WRONG_HUBS:
            self.expect(code, words, ["nodes", "--hub", url])
        for code, words, url in WRONG_HUBS[1:]:
            self.expect(code, [*words[:1], "GIMNET_HUB"], ["nodes"], env={"GIMNET_HUB": self.filled(url)})

    def test_no_hub_on_this_machine(self):
        environment = {"XDG_RUNTIME_DIR": self.places["folder"]}
        code, said = self.run_tool(["nodes"], env=environment)
        if code == 0:
            self.skipTest("a hub runs at the default address of this machine")
        self.assertEqual(code, NO_CONNECTION, said)
        self.assertIn("Start one with `tcphub`, or name yours with --hub", said)

    def test_with_a_hub(self):
        hub = Hub(self, *NOBODY_IS_SILENT)
        start_recv(self, hub, "robot", "--max-size", "100000")
        self.places["robot"] = hub.wait_for_node("robot")["id"]
        Client(self, hub).join("mute")
        start_gimnet(self, hub, "pub", "robot2/odom", "--wait", "1")
        hub.wait_for_node("robot2")
        for code, words, arguments, stdin in WITH_A_HUB:
            self.expect(code, words, ["--hub", hub.url, *arguments], stdin=stdin)

    def test_a_folder_as_standard_input(self):
        hub = Hub(self, *NOBODY_IS_SILENT)
        Client(self, hub).join("B")
        for arguments in (["send", "B"], ["pub", "a/b"]):
            folder = os.open(self.places["folder"], os.O_RDONLY)
            tool = Process([GIMNET, "--hub", hub.url, *arguments], stdin=folder)
            os.close(folder)
            self.addCleanup(tool.end)
            self.assertEqual(tool.wait(), FAILED)
            self.assertEqual(tool.err, "gimnet: cannot read standard input: Is a directory\n")

    def test_an_output_that_is_full(self):
        hub = Hub(self)
        full = "gimnet: cannot write to standard output: No space left on device\n"
        for arguments in (["status"], ["nodes", "--json"], ["services"], ["--help"], ["ping", "B", "-c", "1"]):
            with self.subTest(arguments=arguments), open("/dev/full", "wb") as output:
                if arguments[0] == "ping":
                    start_recv(self, hub, "B")
                self.assertEqual(self.run_tool(["--hub", hub.url, *arguments], stdout=output), (FAILED, full))


class Administration(Tool):
    """What `gimnet ctl` answers to those who may not, and to those who may and ask for what cannot be."""

    # Over TCP, that is as nobody in particular: exit code, words, arguments of ctl.
    DENIED_TO_OTHERS = [(DENIED, ["administrators connect over the hub's Unix socket", "--hub unix:/PATH"], words)
                        for words in (["kick", "robot"], ["reassign", "robot", "7.99"], ["drain"], ["reload"],
                                      ["log", "debug"], ["link", "add", "unix:/a"], ["link", "remove", "a"], ["link", "cost", "a", "5"])]
    # Over the Unix socket. B is {robot}, mute is {mute}.
    CANNOT_BE = [
        (USAGE, ["action is missing: connections, kick, reassign, drain, reload, log or link", "`gimnet ctl " + HOW], []),
        (USAGE, ["there is no action 'kik' of gimnet ctl; did you mean kick?", "`gimnet ctl " + HOW], ["kik", "robot"]),
        (USAGE, ["node is missing: name or id", "`gimnet ctl kick " + HOW], ["kick"]),
        (USAGE, ["node needs a value: name or id"], ["kick", ""]),
        (USAGE, ["new_id is missing: a free id of the same hub: HUB.NUMBER or NUMBER"], ["reassign", "robot"]),
        (USAGE, ["there is no option --reson for gimnet ctl kick; did you mean --reason?"], ["kick", "robot", "--reson", "x"]),
        (NOT_FOUND, ["there is no node 'robto'; did you mean robot?"], ["kick", "robto"]),
        (NOT_FOUND, ["there is no node 7.999 on this hub", LIST], ["kick", "7.999"]),
        (NOT_FOUND, ["there is no node 8.1", LIST], ["kick", "8.1"]),
        (NOT_FOUND, ["there is no node 7.999 on this hub", LIST], ["reassign", "7.999", "7.5000"]),
        (FAILED, ["the id {mute} is that of another node 'mute'; choose a free one"], ["reassign", "robot", "{mute}"]),
        (USAGE, ["'x' is no id: write HUB.NUMBER, for example {robot}"], ["reassign", "robot", "x"]),
        (USAGE, ["the id 8.5 is not one of this hub's, which begin with 7."], ["reassign", "robot", "8.5"]),
        (USAGE, ["a node's id ends in a number from 1 to 1048574"], ["reassign", "robot", "7.1048575"]),
        (USAGE, ["there is no log level 'debgu'", "did you mean debug?"], ["log", "debgu"]),
        (USAGE, ["'loud'", "error, warning, info, debug or off"], ["log", "loud"]),
        (USAGE, ["'now' is one word too many"], ["drain", "now"]),
    ]

    def test_ctl(self):
        hub = Hub(self, *NOBODY_IS_SILENT)
        start_recv(self, hub, "robot")
        self.places["robot"] = hub.wait_for_node("robot")["id"]
        Client(self, hub).join("mute")
        self.places["mute"] = hub.wait_for_node("mute")["id"]
        for code, words, arguments in self.DENIED_TO_OTHERS:
            self.expect(code, words, ["--hub", hub.url, "ctl", *arguments])
        for code, words, arguments in self.CANNOT_BE:
            self.expect(code, words, ["--hub", f"unix:{hub.socket_path}", "ctl", *arguments])
        self.assertEqual(hub.wait_for_node("robot")["id"], self.places["robot"], "nothing was changed")


class Strangers(Tool):
    """What answers at the address is no hub, another version of one, or one that does not let us in."""

    def serve(self, answer):
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)

        def run():
            with listener.accept()[0] as peer:
                peer.settimeout(PATIENCE_S)
                peer.recv(4096)
                peer.sendall(answer)
                if answer:
                    peer.recv(4096)
        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        return f"tcp://127.0.0.1:{listener.getsockname()[1]}"

    def test_a_web_server(self):
        url = self.serve(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n")
        self.expect(NO_CONNECTION, [url, "the peer does not speak GIMnet; is it a hub?"], ["--hub", url, "nodes"])

    def test_who_closes_without_a_word(self):
        url = self.serve(b"")
        self.expect(NO_CONNECTION, [url], ["--hub", url, "nodes"])

    def test_who_never_answers(self):
        """Accepts and is silent until the tool gives up."""
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)
        url = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        self.expect(NO_CONNECTION, [f"the peer at {url} does not answer HELLO; is it a hub, and not stopped?"], ["--hub", url, "nodes"])

    def test_another_version(self):
        body = bytes([3 << 3, 1, 0, 0, 2, 1, 0])
        goodbye = b"\x03\0\0\0" + body
        url = self.serve(b"GIMnet\x02\x00" + len(goodbye).to_bytes(4, "little") + bytes(8) + b"\x10\0\0\1" + goodbye)
        self.expect(BAD_VERSION, [url, "the hub speaks version 2 of the protocol, this program version 1; use a program of the hub's version"], ["--hub", url, "nodes"])

    def test_a_hub_that_is_full(self):
        hub = Hub(self, "--limit", "nodes=1")
        Client(self, hub).join("only")
        self.expect(NO_CONNECTION, [hub.url, "this hub has as many nodes as it takes (1); connect to another one, or start it with a larger"], ["--hub", hub.url, "nodes"])


class SentAway(unittest.TestCase):
    """The hub ends the session of a tool that waits: the tool ends too, and says why."""

    def setUp(self):
        self.hub = Hub(self, *NOBODY_IS_SILENT)
        Client(self, self.hub).join("mute")

    def kick_the_tools(self):
        """All nodes of gimnet that are there: the one that runs, and those that ask and are gone by then."""
        def there():
            found = run_gimnet(self.hub, "nodes", "--all", "--json")
            ids = [node["id"] for node in json.loads(found.out) if node["description"] == "gimnet tool"]
            return ids if len(ids) > 1 else None
        for node in wait_until(there, "the tool's node"):
            run_gimnet(f"unix:{self.hub.socket_path}", "ctl", "kick", node, "--reason", "too loud")

    def ends(self, tool, code, *words):
        self.assertEqual(tool.wait(), code, tool.err)
        for word in words:
            self.assertIn(word, tool.err)
        for word in ("trying to connect again", "nif_"):
            self.assertNotIn(word, tool.err)

    def test_by_an_administrator(self):
        for words in (["recv", "--name", "B"], ["echo", "a/b"], ["echo", "**"], ["hz", "a/b"], ["bw", "**"], ["watch"],
                      ["pub", "a/b"], ["pub", "a/b", "--wait", "1"], ["ping", "mute", "-W", "600"], ["send", "mute"]):
            with self.subTest(words=words):
                tool = start_gimnet(self, self.hub, *words, stdin=subprocess.PIPE)
                self.kick_the_tools()
                self.ends(tool, NO_CONNECTION, "lost the connection to the hub",
                          "kicked", "too loud", "ask them before you come back")

    def test_by_another_connection_of_its_session(self):
        receiver = start_recv(self, self.hub, "B")
        # Of tests that ended their hub with kill -9 others may lie there.
        path = max(pathlib.Path(HOME.name, "gimnet", "tokens").glob("B.*"), key=lambda path: path.stat().st_mtime_ns)
        record = path.read_bytes()
        size = int.from_bytes(record[10:12], "little")
        Client(self, self.hub).join("B", token=record[16:16 + size])
        self.ends(receiver, NO_CONNECTION, "lost the connection to the hub", "replaced", "took its place",
                  "end the other program, or connect under another name")


class TheHubGoes(unittest.TestCase):
    """Meanwhile, by kill -9."""

    def setUp(self):
        self.hub = Hub(self)

    def kill(self):
        self.hub.process.signal(9)
        self.hub.process.wait()

    def ends(self, tool, code, *words):
        self.assertEqual(tool.wait(), code, tool.err)
        for word in words:
            self.assertIn(word, tool.err)
        self.assertNotIn("nif_", tool.err)

    def test_send(self):
        receiver = start_recv(self, self.hub, "B")
        sender = start_gimnet(self, self.hub, "send", "B", stdin=subprocess.PIPE)
        sender.popen.stdin.write(b"first\n")
        sender.popen.stdin.flush()
        wait_until(lambda: receiver.out, "the first message")
        self.kill()
        sender.feed(b"second\n")
        self.ends(sender, NO_CONNECTION, "the connection", "hub", "messages were acknowledged")

    def test_ping(self):
        start_recv(self, self.hub, "B")
        ping = start_gimnet(self, self.hub, "ping", "B", "-c", "1000000", "-i", "0.01")
        wait_until(lambda: ping.out, "an answer")
        self.kill()
        self.ends(ping, NO_CONNECTION, "lost the connection to the hub")

    def test_those_that_wait_say_so_and_go_on(self):
        tools = [start_recv(self, self.hub, "B")]
        for words in (["echo", "a/b"], ["echo", "**"], ["hz", "a/b"], ["bw", "**"]):
            tools.append(start_gimnet(self, self.hub, *words))
        for tool in tools:
            wait_until(lambda tool=tool: tool.err, "the words that it waits")
        self.kill()
        self.all_go_on(tools)

    def test_those_that_publish_or_watch_say_so_too(self):
        lines = start_gimnet(self, self.hub, "pub", "P/s", "--rate", "20", stdin=subprocess.PIPE).feed(b"x\n" * 5000)
        stays = start_gimnet(self, self.hub, "pub", "Q/s", "--stay")
        waits = start_gimnet(self, self.hub, "pub", "W/s", "--wait", "2")
        watch = start_gimnet(self, self.hub, "watch", "**", "--json")
        for name in ("P", "Q", "W"):
            wait_until(lambda name=name: f'"name":"{name}"'.encode() in watch.out, f"the node {name}")
        wait_until(lambda: "the service stays until Ctrl-C" in stays.err, "the end of its input")
        self.kill()
        self.all_go_on([lines, stays, waits, watch])

    def all_go_on(self, tools):
        for tool in tools:
            wait_until(lambda tool=tool: "the connection broke (" in tool.err, "the words that it broke")
            self.assertIn("trying to connect again", tool.err)
            self.assertIsNone(tool.popen.poll())
            tool.signal(2)
            self.assertEqual(tool.wait(), 130, tool.err)


if __name__ == "__main__":
    unittest.main()
