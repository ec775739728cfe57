#!/usr/bin/env python3
"""A hostile node behind a correct hub: it sends random frames to five programs, and none of them loses its connection or a
message between them. GIMNET_SEED=N sends the frames of an earlier run again."""

import collections
import json
import os
import random
import signal
import struct
import subprocess
import threading
import time
import unittest

from support.hostile_frames import GIMI_PING, GIMI_PONG, HostileFrames, Surroundings
from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.waiting import wait_until
from support.wire import FLAG_FRAGMENT, FLAG_KEYED, FLAG_REPORT, GROUP, NS, OPENING, REPORT, UNICAST, WELCOME, Client, Closed, hello, number, text

FULL = os.environ.get("GIMNET_STRESS") == "full"
SECONDS = 60 if FULL else 5
SEED = int(os.environ.get("GIMNET_SEED", "0")) or random.SystemRandom().getrandbits(32)
ADVERTISE, SUBSCRIBE = 7, 10
ACCEPTS = 1
BATCH_BYTES = 64 * 1024
BACKGROUND = 3


def line(count, size):
    return f"{count} " + (f"{count:x}." * (size // 2 + 1))[:size]


class Arrivals:
    """The numbers of the good lines that a program printed as objects, by their sender."""

    def __init__(self, test):
        self.numbers = collections.defaultdict(list)
        output, self.input = os.pipe()
        test.addCleanup(os.close, self.input)
        threading.Thread(target=self._read, args=(os.fdopen(output, "rb"),), daemon=True).start()

    def _read(self, output):
        with output:
            for printed in output:
                got = json.loads(printed)
                head, _, rest = got.get("text", "").partition(" ")
                if head.isdecimal() and got["text"] == line(int(head), len(rest)):
                    self.numbers[got["from"]].append(int(head))


class HostileNode:
    """Sends what HostileFrames makes, and comes back whenever the hub closed its connection. Now and then it does not read
    what it is answered."""

    def __init__(self, test, hub, victims):
        self._test, self._hub = test, hub
        self._around = Surroundings()
        self._around.nodes = victims
        self._frames = HostileFrames(SEED, self._around)
        self._random = random.Random(SEED + 1)
        self._client, self._waiting = None, bytearray()
        self.connections = 0

    def _connect(self):
        """Has a service to which `echo` subscribes, and hears that of `pub`."""
        self.connections += 1
        self._client = client = Client(self._test, self._hub)
        client.send(OPENING + hello(f"evil{self.connections % 8}"))
        answer = client.first_answer()
        if answer.operation != WELCOME:
            raise Closed()  # the hub has not seen yet that the former connection ended
        around, client.id = self._around, answer.dst
        own = [client.ask(NS, ADVERTISE, text(3, "odom")),
               client.ask(NS, ADVERTISE, text(3, "sink") + number(6, 2, ACCEPTS))]
        around.own_id, around.own_groups = client.id, [answer[3] for answer in own]
        around.groups = [client.ask(NS, SUBSCRIBE, text(3, "P/odom"))[4], *around.own_groups]
        self._reads = self._random.random() < 0.7
        self._waiting.clear()
        client.socket.setblocking(False)

    def send_some(self):
        try:
            if self._client is None:
                self._connect()
            while len(self._waiting) < BATCH_BYTES:
                self._waiting += self._frames.next()
            self._write()
        except (OSError, Closed):
            self.leave()

    def _write(self):
        """What the hub does not read now waits for the next time."""
        deadline = time.monotonic() + 0.1
        while self._waiting and time.monotonic() < deadline:
            if self._reads:
                self._read()
            try:
                del self._waiting[:self._client.socket.send(self._waiting)]
            except BlockingIOError:
                pass

    def _read(self):
        try:
            while got := self._client.socket.recv(1 << 16):
                if len(got) > 32 and got[12] == GROUP:  # behind header and key stands the epoch of a stream
                    self._around.epochs = [struct.unpack_from("<I", got, 24)[0], *self._around.epochs[:7]]
            raise Closed()
        except BlockingIOError:
            pass

    def leave(self):
        if self._client is not None:
            self._client.socket.close()
        self._client = None


class Witness:
    """Asks programs whether they are there, behind all that they were sent before."""

    def __init__(self, test, hub):
        self._client = Client(test, hub).join("witness")
        self._asked = 0

    def ask(self, nodes):
        client, waiting = self._client, set(nodes)
        self._asked += 1
        ping = bytes(8) + struct.pack("<IIBBHq", 1, self._asked, GIMI_PING, 0, 0, 0)
        for node in waiting:
            client.send(client.frame(node, ping, flags=FLAG_KEYED | FLAG_REPORT, lane=BACKGROUND))
        while waiting:
            got = client.next_where(lambda got: got.kind in (UNICAST, REPORT))
            if got.kind == REPORT:
                raise AssertionError(f"a program lost its connection: it was reported with reason {got.payload[0]}")
            if got.flags == FLAG_KEYED and got.payload[12:17] == struct.pack("<IB", self._asked, GIMI_PONG):
                waiting.discard(got.src)


class NodesThatDoNotRead(unittest.TestCase):
    def test_what_a_node_is_answered_and_does_not_read_holds_nobody_up(self):
        hub = Hub(self, *(word for name in ("block_ms", "silent_ms", "slow_consumer_ms") for word in
                          ("--limit", f"{name}=600000")))
        recv = start_recv(self, hub, "R")
        to = int(hub.wait_for_node("R")["id"].partition(".")[2]) | 7 << 20
        hostile = Client(self, hub, receive_bytes=4096).join()
        asking = bytes(8) + struct.pack("<IIBBHq", 1, 1, GIMI_PING, 0, 0, 0)
        for number in range(0, 60_000, 1000):
            # Each beginning of a message that is too large is refused, each ping answered.
            hostile.send(b"".join(
                hostile.frame(to, struct.pack("<III", number + i, 0, 1 << 30) + b"x", flags=FLAG_FRAGMENT) +
                hostile.frame(to, asking, flags=FLAG_KEYED) for i in range(1000)))
        lines = b"".join(b"line %d\n" % i for i in range(1000))
        send = run_gimnet(hub, "send", "R", data=lines)
        self.assertEqual(send.code, 0, send.err)
        wait_until(lambda: recv.out == lines, "all lines")


class HostileNodes(unittest.TestCase):
    def setUp(self):
        print(f"GIMNET_SEED={SEED}", flush=True)
        self.hub = Hub(self, shards=2)
        self.ids = {}

    def start(self, *words, **pipes):
        """The program, when the hub knows it."""
        program = start_gimnet(self, self.hub, *words, "--json", **pipes)
        self.ids[words[0]] = wait_until(lambda: self.all_ids() - set(self.ids.values()), f"gimnet {words[0]}").pop()
        program.lines = 0
        return program

    def all_ids(self):
        """Without the tool that asks, which is another node each time."""
        asked = [json.loads(run_gimnet(self.hub, "nodes", "--all", "--json").out) for _ in range(2)]
        return set.intersection(*({node["id"] for node in nodes} for nodes in asked))

    def feed(self, program, size):
        program.popen.stdin.write(line(program.lines, size).encode() + b"\n")
        program.popen.stdin.flush()
        program.lines += 1

    def test_random_frames_cost_nobody_a_connection_or_a_message(self):
        published, received = Arrivals(self), Arrivals(self)
        pub = self.start("pub", "P/odom", "--wait", "1", stdin=subprocess.PIPE)
        echo = self.start("echo", "*/odom", stdout=published.input)
        wait_until(lambda: [service for service in json.loads(run_gimnet(self.hub, "services", "P/*", "--json").out)
                            if service["subscribers"]], "the subscription")
        recv = self.start("recv", "--name", "R", stdout=received.input)
        send = self.start("send", "R", stdin=subprocess.PIPE)
        ping = self.start("ping", "R", "-c", "1000000000", "-i", "0.005", "-W", "60")
        self.live_beside_a_hostile_node(pub, send)
        for program, arrivals in ((pub, published), (send, received)):
            program.popen.stdin.close()
            self.assertEqual(program.wait(), 0, program.err)
            numbers = arrivals.numbers[self.ids[program.popen.args[3]]]
            wait_until(lambda: len(numbers) >= program.lines, "all lines")
            self.assertEqual(numbers, list(range(program.lines)))
        self.assertEqual(json.loads(send.out),
                         {"sent": send.lines, "acknowledged": send.lines, "lost": 0, "waiting": 0})
        for program in (ping, echo, recv):
            program.signal(signal.SIGINT)
            self.assertEqual(program.wait(), 130, program.err)
        self.assertEqual(json.loads(ping.out)["lost"], 0)
        for program in (recv, send, echo, pub, ping):
            self.assertNotRegex(program.err, "the connection broke|lost the connection|connected again")

    def live_beside_a_hostile_node(self, pub, send):
        nodes = {words: int(identity.partition(".")[2]) | 7 << 20 for words, identity in self.ids.items()}
        witness, hostile = Witness(self, self.hub), HostileNode(self, self.hub, list(nodes.values()))
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            for _ in range(4):
                self.feed(pub, 20_000 if pub.lines % 20 == 10 else 100)
            for _ in range(2):
                self.feed(send, {20: 1_500_000, 10: 20_000}.get(send.lines % 40, 100))
            hostile.send_some()
            witness.ask(nodes.values())
        hostile.leave()
        print(f"{hostile.connections} connections of the hostile node, {send.lines} lines sent, {pub.lines} published")


if __name__ == "__main__":
    unittest.main()
