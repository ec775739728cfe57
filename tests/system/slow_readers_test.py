#!/usr/bin/env python3
"""Receivers that are slow, stopped, or that flood each other: nobody else notices."""

import json
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

from rate_proxy import RateProxy
from support.pacing import ByteReader, SlowReader
from support.processes import GIMNET, Hub, run_gimnet, start_gimnet, start_recv
from support.waiting import PATIENCE_S, wait_until
from support.wire import (DROP, FLAG_FRAGMENT, FLAG_KEYED, FLOW, GROUP, LATEST, NS, PAUSE, PONG, UNICAST, Client, number,
                          text)

MEGABYTE = 1_000_000
RECEIVE_BUFFER = 64 * 1024
FRAGMENT_HEADER, KEY, GIMI_HEADER = 12, 8, 20


def is_connected(hub, name):
    return any(node["connected"] for node in hub.nodes() if node["name"] == name)


class Stream:
    """Numbers, 20 a second, from one client to one destination, until the test ends. `sent` is the last one."""

    def __init__(self, test, client, destination, kind):
        self.sent = 0
        self._client, self._destination, self._kind = client, destination, kind
        self._stopping = threading.Event()
        thread = threading.Thread(target=self._run)
        thread.start()
        test.addCleanup(thread.join)
        test.addCleanup(self._stopping.set)

    def _run(self):
        while not self._stopping.wait(0.05):
            self.sent += 1
            data = bytes(KEY) + struct.pack("<IIBBH", 1, self.sent, 0, 0, 0) + b"%d" % self.sent
            self._client.send(self._client.frame(self._destination, data, kind=self._kind, flags=FLAG_KEYED))


class Stopped(unittest.TestCase):
    def test_a_stopped_receiver_is_closed_as_silent_and_told_when_it_is_back(self):
        hub = Hub(self, shards=2)
        stopped = start_recv(self, hub, "stopped", "-n", "20", "--shard", "0")
        first = run_gimnet(hub, "send", "stopped", data=b"before\n" * 10)
        self.assertEqual(first.code, 0, first.err)
        stopped.signal(signal.SIGSTOP)
        lines = b"line\n" * 5000
        deadline = time.monotonic() + PATIENCE_S
        rounds = 0
        while is_connected(hub, "stopped"):
            self.assertLess(time.monotonic(), deadline, "the stopped receiver was never closed")
            other = start_recv(self, hub, "other", "-n", "5000", "--shard", str(rounds % 2))
            sent = run_gimnet(hub, "send", "other", "--shard", "0", data=lines)
            self.assertEqual((sent.code, other.wait()), (0, 0), sent.err)
            self.assertEqual(other.out, lines)
            rounds += 1
        self.assertEqual(hub.counter("silent"), 1)
        stopped.signal(signal.SIGCONT)
        wait_until(lambda: is_connected(hub, "stopped"), "back again")
        second = run_gimnet(hub, "send", "stopped", data=b"after\n" * 10)
        self.assertEqual((second.code, stopped.wait()), (0, 0), second.err)
        self.assertIn("silent", stopped.err, "the reason, told to the receiver also if it ends at once")
        self.assertEqual(stopped.out, b"before\n" * 10 + b"after\n" * 10)

    def cut_off(self, command, *arguments):
        """20 messages a second: a reader for whom there is always a next one looks at its connection all the same."""
        hub = Hub(self)
        source = Client(self, hub).join("A")
        source.pong = lambda ping: None  # whatever it sends tells the hub that it is alive
        group = source.ask(NS, 7, text(3, "B"))[3]
        reader = start_gimnet(self, hub, command, *arguments, "--raw")
        destination, kind = group, GROUP
        if command == "recv":
            hub_id, index = map(int, hub.wait_for_node("R")["id"].split("."))
            destination, kind = hub_id << 20 | index, UNICAST
        stream = Stream(self, source, destination, kind)
        wait_until(lambda: reader.out, "a message")
        reader.signal(signal.SIGSTOP)
        wait_until(lambda: hub.counter("silent") == 1, "the hub to close it as silent")
        last = stream.sent  # what is sent from now on can come over another connection only
        reader.signal(signal.SIGCONT)
        wait_until(lambda: int(reader.out.split()[-1]) > last, "a message after that")
        reader.signal(signal.SIGINT)
        self.assertEqual(reader.wait(), 130, reader.err)
        self.assertRegex(reader.err, "gimnet: the connection broke \\(.*\n(.*\n)*gimnet: connected again as ")
        self.assertIn("silent", reader.err)
        self.assertNotIn("too slow", reader.err)

    def test_echo_of_a_live_stream_says_that_it_was_cut_off_and_why(self):
        self.cut_off("echo", "A/B")

    def test_recv_of_a_live_stream_says_that_it_was_cut_off_and_why(self):
        self.cut_off("recv", "--name", "R")

    def test_who_keeps_alive_but_does_not_read_is_a_slow_consumer(self):
        hub = Hub(self, "--limit", "slow_consumer_ms=1000", "--limit", "silent_ms=60000")
        slow = Client(self, hub, receive_bytes=4096).join("slow")
        sender = Client(self, hub).join()
        for _ in range(100):
            sender.send(sender.frame(slow.id, bytes(60000), lane=2, flags=DROP))

        def closed():
            try:
                slow.ping()
            except OSError:
                pass
            return hub.counter("slow_consumers") == 1
        wait_until(closed, "a slow consumer")
        again = Client(self, hub).join("slow", token=slow.welcome[2])
        self.assertEqual((again.id, again.welcome[16]), (slow.id, 10), "told the reason when it is back")
        self.assertTrue(again.welcome[17])


class RealTime(unittest.TestCase):
    def overtake(self, bulk_shard, real_time_shard):
        """Bytes of bulk that a reader of 1 MB/s takes between the moment at which its shard has a real-time message and
        the message's arrival."""
        hub = Hub(self, shards=2)
        reader = Client(self, hub, receive_bytes=RECEIVE_BUFFER).join("reader", shard=0)
        real_time = Client(self, hub).join(shard=real_time_shard)
        witness = Client(self, hub).join(shard=0)
        chunk = bytes(32 * 1024)
        bulk = [Client(self, hub).join(shard=bulk_shard) for _ in range(8)]
        threads = [threading.Thread(target=self.flood, args=(client, reader.id, chunk, 64), daemon=True)
                   for client in bulk]  # 16 MiB together
        for thread in threads:
            thread.start()
        paced = SlowReader(reader, MEGABYTE)
        taken = 0
        while taken < MEGABYTE:
            taken += len(paced.next().payload)
        real_time.send(real_time.frame(reader.id, b"now", lane=0))
        # What comes on the same way after it shows that the reader's shard has it.
        real_time.send(real_time.frame(witness.id, b"sent", lane=0))
        witness.next_data()
        ahead = 0
        while True:
            got = paced.next()
            if got.lane == 0 and got.payload == b"now":
                break
            ahead += len(got.payload)
        for client in [*bulk, reader]:
            client.socket.close()
        for thread in threads:
            thread.join()
        return ahead

    @staticmethod
    def flood(client, to, chunk, count):
        try:
            for _ in range(count):
                client.send(client.frame(to, chunk, lane=2))
        except OSError:
            pass  # closed at the end of the test

    def test_goes_before_bulk_of_the_same_shard(self):
        self.assertLessEqual(self.overtake(0, 0), 256 * 1024)

    def test_goes_before_bulk_of_another_shard(self):
        self.assertLessEqual(self.overtake(1, 1), 256 * 1024)


class Messages:
    """Puts the messages of a service together; AssertionError if one is torn."""

    def __init__(self):
        self._parts, self._number = b"", None

    def add(self, got):
        """The message that this frame makes whole, or None."""
        assert got.goodbye is None, got.fields
        if got.kind != GROUP:
            return None
        assert got.flags & FLAG_FRAGMENT, got
        message, offset, total = struct.unpack_from("<III", got.payload)
        if offset == 0:
            assert self._number is None, "torn"
            self._parts, self._number = b"", message
        assert (message, offset) == (self._number, len(self._parts)), (message, offset, self._number)
        self._parts += got.payload[FRAGMENT_HEADER + KEY:]
        if len(self._parts) < total:
            return None
        self._number = None
        return self._parts


class Latest(unittest.TestCase):
    SIZE = 200_000

    def test_a_slow_reader_always_gets_the_newest(self):
        """100 messages a second towards a reader of 1 MB/s: 10,000 bytes from one to the next. What is judged are the
        bytes that it takes between a message's publication and its arrival, so a slow machine is only slow."""
        hub = Hub(self)
        client = Client(self, hub, receive_bytes=RECEIVE_BUFFER).join()
        publisher = Client(self, hub).join("camera")
        group = publisher.ask(NS, 7, text(3, "image") + number(7, 2, 1))[3]
        self.assertEqual(client.ask(NS, 10, text(3, "camera/image"))[4], group)
        reader, messages, published, ages = ByteReader(client, MEGABYTE), Messages(), [], {}
        while len(published) < 300:
            self.publish(publisher, group, len(published))
            published.append(reader.taken)
            client.ping()
            for got, position in reader.take(MEGABYTE // 100):
                message = messages.add(got)
                if message:
                    self.assertEqual(len(message), self.SIZE)
                    arrived = int(message[-9:])
                    ages[arrived] = position - published[arrived]
        self.assertEqual(list(ages), sorted(ages))
        self.assertLessEqual(max(ages.values()), 2 * self.SIZE + RECEIVE_BUFFER, ages)
        self.assertGreaterEqual(len(ages), reader.taken // self.SIZE - 1)
        self.assertGreater(hub.counter("dropped.replaced"), 0)

    def publish(self, publisher, group, message):
        """Returns when the hub has it all: bytes on their way to the hub are nobody's delay here."""
        data = str(message).encode().rjust(self.SIZE, b"0")
        for offset in range(0, self.SIZE, 50_000):
            header = struct.pack("<III", message + 1, offset, self.SIZE) + bytes(KEY)
            publisher.send(publisher.frame(group, header + data[offset:offset + 50_000], kind=GROUP, lane=2,
                                           flags=LATEST | FLAG_FRAGMENT | FLAG_KEYED))
        publisher.ping(message)
        publisher.next_where(lambda got: got.kind == FLOW and got.payload[:1] == bytes([PONG]) and
                             struct.unpack_from("<I", got.payload, 4)[0] == message)

    def test_gimnet_pub_to_a_slow_reader(self):
        hub = Hub(self)
        client = Client(self, hub, receive_bytes=RECEIVE_BUFFER).join()
        client.ask(NS, 10, text(3, "camera/image"))
        lines = b"".join(str(number).encode().rjust(self.SIZE, b"0") + b"\n" for number in range(100))
        pub = start_gimnet(self, hub, "pub", "camera/image", "--delivery", "latest", "--lane", "bulk", "--wait", "1",
                           stdin=subprocess.PIPE).feed(lines)
        reader, messages, numbers = SlowReader(client, MEGABYTE), Messages(), []
        while numbers[-1:] != [99]:
            message = messages.add(reader.next())
            if message:
                self.assertEqual(len(message), GIMI_HEADER + self.SIZE)
                numbers.append(int(message[-9:]))
        self.assertEqual(pub.wait(), 0, pub.err)
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertGreater(hub.counter("dropped.replaced"), 0)


class LargeMessage(unittest.TestCase):
    FIRST_WINDOW = 1 << 20  # until its receiver says how far it may go, the sender goes so far

    def test_waits_with_its_sender_and_not_in_the_hub(self):
        """16 MiB on a way of 16 Mbit/s: the receiver lets the sender no further ahead than that carries."""
        # Senders are told to pause beyond twice the first window. With less room the first window alone would do that,
        # as often as the clocks of a busy machine have it.
        hub = Hub(self, "--limit", f"lane1_bytes={4 * self.FIRST_WINDOW}")
        proxy = RateProxy(hub.port, down_bits_per_s=16e6)
        self.addCleanup(proxy.close)
        receiver = start_gimnet(self, proxy, "recv", "--name", "B", "--raw", "-n", "1")
        hub.wait_for_node("B")
        queued = []
        with tempfile.NamedTemporaryFile() as file:
            file.write(bytes(16 << 20))
            file.flush()
            sender = start_gimnet(self, hub, "send", "B", "--file", file.name)
            while sender.popen.poll() is None:
                connections = json.loads(run_gimnet(hub, "ctl", "connections", "--json").out)
                queued.append(max(connection["queued_bytes"] for connection in connections))
            self.assertEqual(sender.wait(), 0, sender.err)
        self.assertEqual(receiver.wait(), 0, receiver.err)
        self.assertEqual(receiver.out_size, (16 << 20) + 1, "the payload and a newline")
        self.assertLessEqual(max(queued), self.FIRST_WINDOW)
        self.assertEqual(hub.counter("pauses"), 0)


class Floods(unittest.TestCase):
    def test_two_nodes_that_flood_each_other_do_not_stand_still(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                hub = Hub(self, shards=shards)
                first = Client(self, hub).join(shard=0)
                second = Client(self, hub).join(shard=shards - 1)
                got = {}
                threads = []
                for client, peer in ((first, second), (second, first)):
                    client.pong = lambda ping: None  # whatever this end sends tells the hub that it is alive
                    threads.append(threading.Thread(target=self.send, args=(client, peer.id)))
                    threads.append(threading.Thread(target=self.receive, args=(client, got)))
                for thread in threads:
                    thread.start()
                for thread in threads:
                    thread.join(2 * PATIENCE_S)
                    self.assertFalse(thread.is_alive(), "stands still")
                self.assertEqual(got, {first.id: list(range(2000)), second.id: list(range(2000))})
                hub.expect_ledger(self, accepted=first.frames_sent + second.frames_sent,
                                  delivered=first.frames_got + second.frames_got)

    @staticmethod
    def send(client, to):
        for number in range(2000):
            client.send(client.frame(to, struct.pack("<I", number) + bytes(16000)))

    @staticmethod
    def receive(client, got):
        numbers = []
        while len(numbers) < 2000:
            frame = client.next_where(lambda frame: frame.kind == UNICAST)
            numbers.append(struct.unpack_from("<I", frame.payload)[0])
        got[client.id] = numbers

    def test_a_blocked_sender_is_paused_and_resumed(self):
        hub = Hub(self)
        slow = Client(self, hub, receive_bytes=4096).join()
        fast = Client(self, hub).join()
        sender = Client(self, hub).join()
        for _ in range(30):
            sender.send(sender.frame(slow.id, bytes(60000)))
        pause = sender.next_where(lambda got: got.kind == FLOW and got.payload[0] == PAUSE)
        self.assertEqual(struct.unpack_from("<BBxI", pause.payload, 1), (UNICAST, 1, slow.id))
        sender.send(sender.frame(fast.id, b"steer"))
        self.assertEqual(fast.next_data().payload, b"steer")
        for _ in range(30):
            slow.next_data()
        sender.next_where(lambda got: got.kind == FLOW and got.payload[0] == PAUSE + 1)
        hub.expect_ledger(self, accepted=sender.frames_sent, delivered=slow.frames_got + fast.frames_got)

    def test_recv_whose_output_nobody_reads_loses_nothing(self):
        hub = Hub(self)
        data = b"".join(b"%d %s\n" % (number, b"x" * 1000) for number in range(40000))
        with subprocess.Popen([GIMNET, "--hub", hub.url, "recv", "--name", "B", "--raw", "-n", "40000"],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as recv:
            hub.wait_for_node("B")
            send = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE).feed(data)
            accepted = [0, 0, 0]

            def stands_still():
                accepted.append(hub.counter("accepted"))
                return accepted[-1] > 4096 and len(set(accepted[-3:])) == 1
            wait_until(stands_still, "a full way")
            self.assertIsNone(send.popen.poll(), "40 MB fit into no queue")
            self.assertEqual(recv.stdout.read(), data)
        self.assertEqual((send.wait(), recv.returncode), (0, 0), send.err)

    def test_messages_of_any_size_wait_for_a_reader_who_pauses_for_longer_than_the_hub_would(self):
        for size, count in ((300_000, 150), (1_000_000, 50), (2_000_000, 25)):
            with self.subTest(size=size):
                self.pause(b"".join(b"%d %s\n" % (number, b"x" * size) for number in range(count)), count)

    def pause(self, data, count):
        hub = Hub(self, "--limit", "block_ms=300", "--limit", "slow_consumer_ms=600000", "--limit", "silent_ms=600000")
        recv = subprocess.Popen([GIMNET, "--hub", hub.url, "recv", "--name", "B", "--raw", "-n", str(count)],
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self.addCleanup(recv.stdout.close)
        self.addCleanup(recv.wait)
        self.addCleanup(recv.kill)
        hub.wait_for_node("B")
        send = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE).feed(data)
        accepted = [0] * 5

        def stands_still():
            accepted.append(hub.counter("accepted"))
            return accepted[-1] > 100 and len(set(accepted[-5:])) == 1
        wait_until(stands_still, "a full way")
        # What waits at the hub from now on is given up later than this.
        witness, sender = Client(self, hub, receive_bytes=4096).join(), Client(self, hub).join()
        for _ in range(30):
            sender.send(sender.frame(witness.id, bytes(60000)))
        wait_until(lambda: hub.counter("dropped.timed_out") > 0, "the hub to give up what waits")
        got = []
        reading = threading.Thread(target=lambda: got.append(recv.stdout.read()))
        reading.start()
        self.addCleanup(reading.join)
        self.addCleanup(recv.kill)
        self.assertEqual(send.wait(), 0, send.err)
        reading.join()
        self.assertEqual((recv.wait(), got[0] == data), (0, True))


if __name__ == "__main__":
    unittest.main()
