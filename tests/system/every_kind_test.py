#!/usr/bin/env python3
"""Frames of every kind with 0 to 40 random bytes, random flags and lanes, from a node and from a linked hub: no program
loses its connection or a message. GIMNET_SEED=N sends the frames of an earlier run again."""

import os
import random
import subprocess
import unittest

from support.liar import OWN_HUB, Liar
from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.waiting import wait_until
from support.wire import FLOW, LINK, NS, PONG, REPORT, ROUTE, Client, Closed, frame, text

SEED = int(os.environ.get("GIMNET_SEED", "0")) or random.SystemRandom().getrandbits(32)
KINDS = (*range(20), 20, 99, 255)
SIZES = range(41)
ROUNDS = 2
SUBSCRIBE = 10


class EveryKind(unittest.TestCase):
    def setUp(self):
        print(f"GIMNET_SEED={SEED}", flush=True)
        self.random = random.Random(SEED)
        self.hub = Hub(self, "--accept-links", shards=2)
        self.recv = start_recv(self, self.hub, "R")
        self.pub = start_gimnet(self, self.hub, "pub", "P/odom", "--wait", "1", stdin=subprocess.PIPE)
        self.echo = start_gimnet(self, self.hub, "echo", "P/odom", "--raw")
        wait_until(lambda: b"P/odom" in run_gimnet(self.hub, "services", "P/*").out, "the service")
        asking = Client(self, self.hub).join()
        group = asking.ask(NS, SUBSCRIBE, text(3, "P/odom"))[4]
        asking.socket.close()
        nodes = [int(node["id"].partition(".")[2]) | 7 << 20 for node in self.hub.nodes()]
        self.targets = (*nodes, group, group)

    def random_frame(self, kind, size, source):
        roll = self.random
        payload = roll.randbytes(size)
        if kind == FLOW and payload and roll.random() < 0.5:
            payload = bytes([roll.randint(1, 9)]) + payload[1:]
        if kind == REPORT and roll.random() < 0.3:
            flags, lane = 0, roll.randrange(4)  # one that is passed on
        else:
            flags, lane = roll.getrandbits(8), roll.randrange(4) if roll.random() < 0.8 else roll.getrandbits(8)
        flags &= roll.choice((0xFF, 0xFF, 0x3F, 0x07))
        dst = 0 if kind in (LINK, ROUTE) or roll.random() < 0.1 else roll.choice(self.targets)
        return frame(dst, source, payload, kind=kind, flags=flags, lane=lane)

    def expect_all_well(self):
        """All programs have their first connection, and messages come."""
        self.pub.popen.stdin.write(b"published\n")
        self.pub.popen.stdin.flush()
        wait_until(lambda: b"published\n" in self.echo.out, "the published message")
        sent = run_gimnet(self.hub, "send", "R", data=b"sent\n")
        self.assertEqual(sent.code, 0, sent.err)
        wait_until(lambda: b"sent\n" in self.recv.out, "the sent message")
        for program in (self.recv, self.pub, self.echo):
            self.assertIsNone(program.popen.poll(), program.err)
            self.assertNotRegex(program.err, "the connection broke|lost the connection|connected again")
        self.assertEqual(self.hub.counter("resumed"), 0)

    def test_of_a_node(self):
        client, closed = None, 0
        for kind in KINDS * ROUNDS:
            for size in SIZES:
                client = client or Client(self, self.hub).join()
                try:
                    client.send(self.random_frame(kind, size, client.id)).ping()
                    client.next_where(lambda got: got.kind == FLOW and got.payload[0] == PONG)
                except (Closed, OSError):
                    client.socket.close()
                    client, closed = None, closed + 1
        self.assertGreater(closed, 100)
        self.expect_all_well()

    def test_of_a_linked_hub(self):
        liar = Liar(self, self.hub)
        source = OWN_HUB << 20 | 3
        liar.send(frame(self.targets[0], source, b"short", kind=REPORT))
        said = "link to hub 9: dropped a frame of kind 5"
        wait_until(lambda: said in self.hub.process.err, "the log line")
        for kind in KINDS * ROUNDS:
            if kind == LINK:
                continue
            for size in SIZES:
                liar.send(self.random_frame(kind, size, source))
        liar.wait_until_taken()
        self.assertGreater(self.hub.counter("malformed"), 100)
        self.expect_all_well()
        liar.send(frame(0, source, b"the last word", kind=LINK))
        wait_until(lambda: liar.closed, "the end of the link")
        self.expect_all_well()


if __name__ == "__main__":
    unittest.main()
