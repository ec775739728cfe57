#!/usr/bin/env python3
"""Patterns in `gimnet echo`, `hz` and `bw`: what comes, goes and comes back while they run, and what they say of what they
could not get."""

import json
import signal
import struct
import subprocess
import unittest

from support.processes import Hub, run_gimnet, start_gimnet
from support.proxy import Proxy
from support.waiting import wait_until
from support.wire import FLAG_KEYED, GROUP, NS, Client, number, text

DATA = 0  # operation of GIMI
ADVERTISE, WITHDRAW = 7, 8
ACCEPTS = number(6, 2, 1)
KEY = 8
CAME_AND_WENT = "came and went, and nothing came of it: what is published before this node has heard of a service"


def asked(hub, operation):
    """How often the hub was asked that about names and services."""
    return hub.status()["counters"].get("names." + operation, 0)


# A raw client that waits for others answers no keep-alive.
PATIENT = ["--limit", "keep_alive_ms=60000", "--limit", "silent_ms=600000"]


class Provider:
    """A node that sends what it is told to, whether somebody has subscribed or not."""

    def __init__(self, test, hub, name="r"):
        self._client = Client(test, hub).join(name)
        self._group = None
        self.subscribers = None  # as its service began

    def advertise(self, terms=b""):
        answer = self._client.ask(NS, ADVERTISE, text(3, "s") + terms)
        self._group, self.subscribers = answer[3], answer[4]
        return self

    def withdraw(self):
        self._client.ask(NS, WITHDRAW, number(3, 4, self._group))

    def publish(self, sequence, payload=b"x"):
        data = struct.pack("<IIBBH", 1, sequence, DATA, 0, 0) + payload
        self._client.send(self._client.frame(self._group, bytes(KEY) + data, kind=GROUP, flags=FLAG_KEYED))


class Patterns(unittest.TestCase):
    def start(self, hub, *words, waits=True):
        tool = start_gimnet(self, hub, *words)
        if waits:
            wait_until(lambda: "yet; waiting for one" in tool.err, "the words that it waits")
        return tool

    @staticmethod
    def subscribers(hub, service):
        found = json.loads(run_gimnet(hub, "services", service, "--json").out)
        return found[0]["subscribers"] if found else None

    def wait_for_subscribers(self, hub, service, count=1):
        wait_until(lambda: self.subscribers(hub, service) == count, f"{count} subscribers of {service}")

    def test_who_waits_for_a_subscriber_loses_nothing(self):
        hub = Hub(self, shards=2)
        echo = self.start(hub, "echo", "S/*", "--json")
        for service in ("S/x", "S/y", "S/x", "S/z"):
            pub = run_gimnet(hub, "pub", service, "--wait", "1", data=b"a\nb\nc\n")
            self.assertEqual((pub.code, "to nobody" in pub.err), (0, False), pub.err)
        wait_until(lambda: echo.out.count(b"\n") == 12, "all lines")
        echo.signal(signal.SIGINT)
        self.assertEqual(echo.wait(), 130, echo.err)
        said = [json.loads(line) for line in echo.out.splitlines()]
        self.assertEqual([(one["service"], one["text"], one["missed"]) for one in said],
                         [(service, line, 0) for service in ("S/x", "S/y", "S/x", "S/z") for line in "abc"])
        hub.expect_ledger(self, accepted=12, delivered=12)

    def test_they_are_told_and_do_not_ask(self):
        hub = Hub(self)
        tools = [self.start(hub, command, "r/*") for command in ("echo", "hz", "bw")]
        pub = start_gimnet(self, hub, "pub", "r/s", "--wait", "3", stdin=subprocess.PIPE).feed(b"x\n" * 5)
        self.assertEqual(pub.wait(), 0, pub.err)
        wait_until(lambda: tools[0].out.count(b"\n") == 5, "the messages")
        # `pub` asks once, at its end, what subscribers missed.
        self.assertEqual((asked(hub, "services"), asked(hub, "watch")), (1, 3))
        for tool in tools:
            self.assertIsNone(tool.popen.poll(), tool.err)

    def test_what_was_published_before_is_said_at_the_first_that_comes(self):
        hub = Hub(self, *PATIENT)
        early = Provider(self, hub, "early").advertise()
        lines = self.start(hub, "echo", "*/s", "-n", "4", waits=False)
        objects = self.start(hub, "echo", "*/s", "-n", "4", "--json", waits=False)
        self.wait_for_subscribers(hub, "early/s", 2)
        early.publish(943)
        for tool in (lines, objects):
            wait_until(lambda tool=tool: tool.out, "a message of whom it found there")
        late = Provider(self, hub, "late").advertise()
        self.wait_for_subscribers(hub, "late/s", 2)
        for sequence in (4, 5):
            late.publish(sequence)
        for tool in (lines, objects):
            wait_until(lambda tool=tool: tool.out.count(b"\n") == 3, "what came of the one that is late")
        early.publish(944)
        for tool in (lines, objects):
            self.assertEqual(tool.wait(), 0, tool.err)
            self.assertEqual(tool.err, "gimnet: 3 messages of late/s did not come: published before this node had heard "
                                       "of the service and subscribed to it\n")
        said = [json.loads(line) for line in objects.out.splitlines()]
        self.assertEqual([(one["service"], one["missed"]) for one in said],
                         [("early/s", 0), ("late/s", 3), ("late/s", 3), ("early/s", 0)])

    def test_who_came_and_went_is_named_and_does_not_lose_the_next_time(self):
        hub = Hub(self, *PATIENT)
        tools = [self.start(hub, command, "r/*", "-n", "1") for command in ("echo", "hz")]
        provider = Provider(self, hub).advertise()
        provider.withdraw()
        for tool in tools:
            wait_until(lambda tool=tool: "gimnet: r/s " + CAME_AND_WENT in tool.err, "the words about it")
        wait_until(lambda: asked(hub, "subscribe") == 2, "subscriptions, for the next time")
        provider.advertise()
        self.assertEqual(provider.subscribers, 2)
        provider.publish(1)
        for tool in tools:
            self.assertEqual(tool.wait(), 0, tool.err)
            self.assertEqual(tool.err.count("came and went"), 1, tool.err)
            self.assertNotIn("did not come", tool.err)

    def test_who_came_and_went_last_is_named_at_the_end(self):
        hub = Hub(self, *PATIENT)
        echo = self.start(hub, "echo", "r/*")
        provider = Provider(self, hub).advertise()
        provider.withdraw()
        wait_until(lambda: asked(hub, "subscribe") == 1, "its subscription")
        echo.signal(signal.SIGINT)
        self.assertEqual(echo.wait(), 130, echo.err)
        self.assertIn("gimnet: r/s " + CAME_AND_WENT, echo.err)

    def test_who_takes_data_gives_none(self):
        hub = Hub(self, *PATIENT)
        echo = self.start(hub, "echo", "*/s", "-n", "1", "--raw")
        Provider(self, hub, "a").advertise(ACCEPTS)
        provider = Provider(self, hub, "b").advertise()
        self.wait_for_subscribers(hub, "b/s")
        self.assertEqual(self.subscribers(hub, "a/s"), 0)
        provider.publish(1, b"of b")
        self.assertEqual((echo.wait(), echo.out), (0, b"of b\n"), echo.err)

    def test_as_many_as_a_node_may_subscribe_to_and_one_more(self):
        hub = Hub(self, *PATIENT, "--limit", "subscriptions_per_node=2")
        first, second, third = (Provider(self, hub, name).advertise() for name in "abc")
        echo = self.start(hub, "echo", "*/s", "--raw", waits=False)
        wait_until(lambda: "cannot subscribe" in echo.err, "the words about the third")
        self.assertIn("subscriptions_per_node", echo.err)
        self.assertIn("trying again once a second", echo.err)
        counts = [self.subscribers(hub, f"{name}/s") for name in "abc"]
        self.assertEqual(sorted(counts), [0, 1, 1])
        # One that goes makes room.
        for count, provider in zip(counts, (first, second, third)):
            if count == 1:
                provider.withdraw()
                break
        left = [name for name, provider in zip("abc", (first, second, third))
                if self.subscribers(hub, f"{name}/s") is not None]
        self.assertEqual(len(left), 2)
        for name in left:
            self.wait_for_subscribers(hub, f"{name}/s")
        self.assertIsNone(echo.popen.poll())
        self.assertEqual(echo.err.count("cannot subscribe"), 1, "once")

    def test_they_go_on_when_the_hub_was_killed(self):
        hub = Hub(self)
        echo = self.start(hub, "echo", "*/s", "--raw")
        stays = start_gimnet(self, hub, "pub", "a/s", "--wait", "1", stdin=subprocess.PIPE)

        def publish(line):
            stays.popen.stdin.write(line)
            stays.popen.stdin.flush()
            wait_until(lambda: line in echo.out, "the line")
        publish(b"before\n")
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        hub = hub.again(self)
        hub.wait_for_node("a")
        self.wait_for_subscribers(hub, "a/s")
        publish(b"behind\n")
        pub = run_gimnet(hub, "pub", "b/s", "--wait", "1", data=b"one\ntwo\n")
        self.assertEqual(pub.code, 0, pub.err)
        wait_until(lambda: echo.out == b"before\nbehind\none\ntwo\n", "all of the newcomer")
        self.assertNotIn("did not come", echo.err)

    def test_they_go_on_behind_a_break(self):
        hub = Hub(self)
        proxy = Proxy(self, hub.port)
        echo = self.start(proxy, "echo", "*/s", "--raw")
        for count, line in enumerate((b"before\n", b"behind\n"), 1):
            pub = run_gimnet(hub, "pub", "a/s", "--wait", "1", data=line)
            self.assertEqual(pub.code, 0, pub.err)
            wait_until(lambda line=line: line in echo.out, "the line")
            proxy.drop_all()
            wait_until(lambda count=count: echo.err.count("connected again") >= count, "its new connection")
        pub = run_gimnet(hub, "pub", "b/s", "--wait", "1", data=b"new\n")
        self.assertEqual(pub.code, 0, pub.err)
        wait_until(lambda: echo.out == b"before\nbehind\nnew\n", "all of the newcomer")

    def test_who_publishes_to_nobody_is_told(self):
        hub = Hub(self)
        pub = run_gimnet(hub, "pub", "r/s", data=b"a\nb\nc\n")
        self.assertEqual((pub.code, pub.err), (0, "gimnet: all 3 lines went to nobody: nobody had subscribed to r/s then; "
                                                  "--wait 1 holds the first until somebody has\n"))
        kept = run_gimnet(hub, "pub", "r/s", "--retain", data=b"a\n")
        self.assertEqual((kept.code, kept.err), (0, ""))

    def test_bad_patterns_are_wrong_arguments(self):
        hub = Hub(self)
        for command in ("echo", "hz", "bw", "watch", "nodes", "services"):
            for pattern in ("a//*", "a/*b", "a/***", "a b/*", "/".join(["*"] * 17)):
                with self.subTest(command=command, pattern=pattern):
                    tool = run_gimnet(hub, command, pattern)
                    self.assertEqual((tool.code, tool.out), (2, b""), tool.err)
                    self.assertIn(pattern, tool.err)

    def test_where_one_node_is_meant_they_are_wrong_arguments(self):
        for words in (["send", "*"], ["ping", "a/*"], ["ctl", "kick", "a*"], ["ctl", "reassign", "**", "7.1"]):
            tool = run_gimnet("tcp://127.0.0.1:1", *words)
            self.assertEqual((tool.code, tool.out), (2, b""), tool.err)
            command = " ".join(words[:2] if words[0] == "ctl" else words[:1])
            pattern = words[2 if words[0] == "ctl" else 1]
            self.assertIn(f"'{pattern}' is a pattern, and gimnet {command} takes one node: `gimnet nodes '{pattern}'` "
                          "lists those that match", tool.err)

    def test_what_matches_nothing_is_said(self):
        hub = Hub(self, *PATIENT)
        Provider(self, hub).advertise()
        for words, code, said in ((["nodes", "r/s"], 4, "no node matches 'r/s': that is a service of the node r"),
                                  (["nodes", "7.999"], 4, "no node matches '7.999'; `gimnet nodes` lists"),
                                  (["services", "nobody/*"], 4, "no service matches 'nobody/*'; `gimnet services` lists"),
                                  (["services", "r"], 4, "no service matches 'r'; did you mean 'r/**'?"),
                                  (["watch", "x/*", "--seconds", "0.05"], 5, "nothing matches x/* yet; waiting"),
                                  (["echo", "x/*", "--seconds", "0.05"], 5, "no service matches x/* yet; waiting")):
            tool = run_gimnet(hub, *words)
            self.assertEqual(tool.code, code, tool.err)
            self.assertIn("gimnet: " + said, tool.err)
        quiet = run_gimnet(hub, "watch", "x/*", "--changes", "--seconds", "0.05")
        self.assertEqual((quiet.code, quiet.err),
                         (5, "gimnet: waited 0.05 s for an event of x/*: none came\n"))

    def test_of_several_services_lines_name_their_own(self):
        hub = Hub(self, *PATIENT)
        provider = Provider(self, hub).advertise()
        tools = [self.start(hub, "echo", word, "-n", "1", waits=False) for word in ("r/*", "r/s")]
        self.wait_for_subscribers(hub, "r/s", 2)
        provider.publish(9)
        self.assertEqual([tool.wait() for tool in tools], [0, 0])
        self.assertRegex(tools[0].out, rb"^r/s 7\.[0-9]+ #9: x\n$")
        self.assertRegex(tools[1].out, rb"^7\.[0-9]+ #9: x\n$")


if __name__ == "__main__":
    unittest.main()
