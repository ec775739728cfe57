#!/usr/bin/env python3
"""What a hub says that each node sent and got is what the nodes counted themselves, and adds up to the hub's ledger."""

import json
import struct
import unittest

from support.processes import Hub, run_gimnet
from support.waiting import wait_until
from support.wire import (BROADCAST, CONFIRM, FLAG_REPORT, FLOW, GROUP, HEADER, LIST, NS, PONG, REPORT, SERVICE, UNICAST, Client,
                          number, text)

# Only what these tests send goes over the connections.
ARGUMENTS = ("--limit", "silent_ms=3000000", "--limit", "keep_alive_ms=600000")
ADVERTISE, SUBSCRIBE = 7, 10
DATA = (UNICAST, GROUP, LIST, BROADCAST, SERVICE)
LEDGER = ("accepted", "delivered", "dropped")
EPOCH = 77


class Counting(Client):
    """A node that counts what it sent and got behind the handshake, as the hub's counters do. `former`: whose connection
    this one takes the place of."""

    def __init__(self, test, hub, former=None):
        super().__init__(test, hub)
        self.counts = former.counts if former else {"accepted": 0, "received_bytes": 0, "delivered": 0, "sent_bytes": 0,
                                                    "dropped": 0}

    def send(self, data):
        if self.id:
            self.counts["received_bytes"] += len(data)
            at = 0
            while at < len(data):
                size, kind = struct.unpack_from("<I8xB", data, at)
                self.counts["accepted"] += kind in DATA
                at += HEADER + size
        return super().send(data)

    def next(self):
        got = super().next()
        if self.id:
            self.counts["sent_bytes"] += HEADER + len(got.payload)
            self.counts["delivered"] += got.kind in DATA
        return got

    def drain(self):
        """Reads all that the hub has written. Twice: a CONFIRM stands behind the first PONG."""
        for _ in range(2):
            self.ping()
            self.next_where(lambda got: got.kind == FLOW and got.payload[0] == PONG)

    def confirm(self, count):
        self.send(self.frame(0, struct.pack("<B7xQ", CONFIRM, count), kind=FLOW))


class Counters(unittest.TestCase):
    def settled(self, hub, nodes):
        """The status of a hub that has nothing more to do, when each node has read what is for it."""
        for node in nodes:
            node.drain()  # so the hub has read what it sent
        wait_until(lambda: hub.quiet_status(self)["ledger"]["queued"] == 0, "nothing that waits")
        for node in nodes:
            node.drain()
        return hub.quiet_status(self)

    def connection(self, status, node):
        wanted = f"{node.id >> 20}.{node.id & 0xFFFFF}"
        return next(connection for connection in status["connections"] if connection["id"] == wanted)

    def counts_of(self, status, node):
        connection = self.connection(status, node)
        return {name: connection[name] for name in node.counts}

    def sums(self, status):
        return {name: sum(connection[name] for connection in status["connections"]) for name in LEDGER}

    def wait_until_away(self, hub, node):
        wait_until(lambda: not self.connection(hub.status(), node)["connected"], "a node that is away")

    def test_nodes_and_hub_count_the_same(self):
        hub = Hub(self, *ARGUMENTS, shards=2)
        nodes = [Counting(self, hub).join(f"n{number}", shard=number % 2) for number in range(6)]
        group = nodes[0].ask(NS, ADVERTISE, text(3, "s"))[3]
        for node in nodes[1:4]:
            node.ask(NS, SUBSCRIBE, text(3, "n0/s"))
        ids = struct.pack("<III", *sorted(node.id for node in nodes[3:]))
        for turn in range(50):
            for place, node in enumerate(nodes):
                node.send(node.frame(nodes[(place + 1) % 6].id, bytes(turn * 7)))
                node.send(node.frame(nodes[(place + 2) % 6].id, b"a") + node.frame(nodes[(place + 2) % 6].id, b"b"))
            nodes[0].send(nodes[0].frame(group, bytes(100), kind=GROUP))
            nodes[1].send(nodes[1].frame(3, ids + b"list", kind=LIST))
        nodes[2].send(nodes[2].frame(0xFFFFFFFF, b"all", kind=BROADCAST))
        status = self.settled(hub, nodes)
        for node in nodes:
            self.assertGreaterEqual(node.counts["accepted"], 150)
            self.assertGreaterEqual(node.counts["delivered"], 150)
            self.assertEqual(self.counts_of(status, node), node.counts)
        self.assertEqual(self.sums(status), {name: status["ledger"][name] for name in LEDGER})
        listed = json.loads(run_gimnet(hub, "ctl", "connections", "--json").out)
        for node in nodes:
            self.assertEqual(self.counts_of({"connections": listed}, node), node.counts)

    def test_drops_count_with_whom_the_frames_were_for(self):
        hub = Hub(self, *ARGUMENTS, shards=2)
        sender = Counting(self, hub).join("sender", shard=0)
        # One on the sender's shard, and one on the other.
        nodes = [Counting(self, hub).join(f"n{shard}", shard=shard, extra=number(6, 4, 4096)) for shard in range(2)]
        for frames, node in enumerate(nodes, 2):
            node.send(node.frame(sender.id, b"before"))
            for _ in range(frames):
                sender.send(sender.frame(node.id, bytes(4097)))
            node.counts["dropped"] += frames
        for _ in range(7):
            sender.send(sender.frame((7 << 20) | 0xABCD, b"nobody"))
        status = self.settled(hub, [sender, *nodes])
        nodes[1].socket.close()
        self.wait_until_away(hub, nodes[1])
        sender.send(sender.frame(nodes[1].id, b"?", flags=FLAG_REPORT))
        sender.next_where(lambda got: got.kind == REPORT)
        nodes[1].counts["dropped"] += 1
        again = Counting(self, hub, former=nodes[1]).join("n1", token=nodes[1].welcome[2], extra=number(6, 4, 4096))
        again.send(again.frame(nodes[0].id, b"behind"))
        nodes[1] = again
        status = self.settled(hub, [sender, *nodes])
        for node in (sender, *nodes):
            self.assertEqual(self.counts_of(status, node), node.counts)
        self.assertEqual([node.counts["dropped"] for node in nodes], [2, 4])
        sums = self.sums(status)
        self.assertEqual(status["counters"]["dropped.no_such_node"], 7)
        self.assertEqual(sums.pop("dropped") + 7, status["ledger"]["dropped"])
        self.assertEqual(sums, {name: status["ledger"][name] for name in sums})

    def test_counts_go_on_over_a_resume_and_another_id(self):
        hub = Hub(self, *ARGUMENTS)
        sender = Counting(self, hub).join("sender")
        node = Counting(self, hub).join("node", extra=number(4, 5, EPOCH) + number(5, 1, True))
        for _ in range(3):
            sender.send(sender.frame(node.id, b"now"))
            node.next_data()
        node.confirm(2)
        node.drain()
        counts = self.counts_of(hub.status(), node)
        self.assertEqual(counts, {**node.counts, "delivered": 2}, "what it has not confirmed may come again")
        node.socket.close()
        self.wait_until_away(hub, node)
        for _ in range(4):
            sender.send(sender.frame(node.id, b"later"))
        sender.drain()
        welcome = node.welcome
        node = Counting(self, hub, former=node)
        node.join(token=welcome[2], extra=number(4, 5, EPOCH) + number(5, 1, True) + number(9, 5, welcome[5]) +
                  number(10, 5, 3))
        self.assertTrue(node.welcome[11])
        for taken in range(4, 8):
            node.next_data()
            node.confirm(taken)
        status = self.settled(hub, [sender, node])
        self.assertEqual(node.counts["delivered"], 7)
        self.assertEqual(self.counts_of(status, node), node.counts)
        admin = f"unix:{hub.socket_path}"
        self.assertEqual(run_gimnet(admin, "ctl", "reassign", "sender", "7.500").code, 0)
        token = sender.welcome[2]
        sender.socket.close()
        sender = Counting(self, hub, former=sender).join("sender", token=token)
        self.assertEqual(sender.id, 7 << 20 | 500)
        sender.send(sender.frame(node.id, b"under another id"))
        node.next_data()
        node.confirm(8)
        status = self.settled(hub, [sender, node])
        for each in (sender, node):
            self.assertEqual(self.counts_of(status, each), each.counts)
        self.assertEqual(self.sums(status), {name: status["ledger"][name] for name in LEDGER})


if __name__ == "__main__":
    unittest.main()
