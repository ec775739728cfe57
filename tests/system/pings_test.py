#!/usr/bin/env python3
"""`gimnet ping`, and the acknowledgements for which `gimnet send` asks by a ping."""

import json
import struct
import subprocess
import unittest

from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.waiting import wait_until
from support.wire import FLAG_KEYED, Client

DATA, ACK, PING = 0, 1, 5  # operations of GIMI
KEY = 8


class Pings(unittest.TestCase):
    def test_every_node_answers(self):
        hub = Hub(self, shards=2)
        start_recv(self, hub, "B", "--shard", "1")
        ping = run_gimnet(hub, "ping", "B", "-c", "200", "-i", "0", "-W", "60", "--json", "--shard", "0")
        self.assertEqual(ping.code, 0, ping.err)
        said = json.loads(ping.out)
        self.assertEqual((said["sent"], said["lost"]), (200, 0))
        self.assertLessEqual(0 < said["min"], said["p50"] <= said["p99"] <= said["p99.9"] <= said["max"])

    def test_who_does_not_answer_is_lost(self):
        hub = Hub(self)
        mute = Client(self, hub).join("mute")
        ping = run_gimnet(hub, "ping", "mute", "-c", "2", "-W", "0.1", "-i", "0", "--json")
        self.assertEqual(ping.code, 5)
        self.assertEqual(json.loads(ping.out)["lost"], 2)
        self.assertEqual(mute.next_data().flags & FLAG_KEYED, FLAG_KEYED)

    def test_nobody_there(self):
        hub = Hub(self)
        self.assertEqual(run_gimnet(hub, "ping", "nobody").code, 4)
        gone = run_gimnet(hub, "ping", "7.999", "-c", "1")
        self.assertEqual(gone.code, 4)
        self.assertIn("no_such_node", gone.err)
        lost = run_gimnet(hub, "ping", "7.999", "-c", "1", "--json")
        self.assertEqual(json.loads(lost.out), {"target": "7.999", "id": "7.999", "sent": 1, "lost": 1, "min": None,
                                                "mean": None, "p50": None, "p99": None, "p99.9": None, "max": None})

    def test_one_that_is_away_is_told(self):
        hub = Hub(self)
        Client(self, hub).join("B").socket.close()
        wait_until(lambda: any(not node["connected"] for node in hub.nodes()), "B away")
        ping = run_gimnet(hub, "ping", "B", "-c", "1", "-W", "0.1")
        self.assertNotEqual(ping.code, 0)
        self.assertIn("the node 'B' is away: its connection broke", ping.err)


class Acknowledgements(unittest.TestCase):
    """`gimnet send` to a raw client, which sees exactly what is on the wire."""

    def test_at_most_64_wait_and_a_ping_asks(self):
        hub = Hub(self)
        client = Client(self, hub).join("B")
        sender = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE).feed(b"x\n" * 100)
        frames = [client.next_data()]
        while self.sequences(frames) != list(range(1, 65)) or frames[-1].payload[KEY + 8] != PING:
            self.assertLessEqual(len(self.sequences(frames)), 64)
            frames.append(client.next_data())
        # An ACK of all but the first: what the PING asked for and the ACK does not name is lost.
        self.acknowledge(client, frames[-1], 64, bitmap=(1 << 62) - 1)
        self.assertEqual(sender.wait(), 1)
        self.assertIn("1 of 64 messages were not acknowledged by B: ", sender.err)
        self.assertIn("; 63 were, and the rest of the input was not sent", sender.err)

    @staticmethod
    def sequences(frames):
        return [struct.unpack_from("<I", got.payload, KEY + 4)[0] for got in frames if got.payload[KEY + 8] == DATA]

    @staticmethod
    def acknowledge(client, ping, highest, bitmap):
        epoch, number = ping.payload[KEY:KEY + 4], ping.payload[KEY + 4:KEY + 8]
        ack = epoch + struct.pack("<IBBHQ", highest, ACK, 0, 0, bitmap) + number
        client.send(client.frame(ping.src, bytes(KEY) + ack, flags=FLAG_KEYED))


if __name__ == "__main__":
    unittest.main()
