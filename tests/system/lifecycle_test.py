#!/usr/bin/env python3
"""A hub's start and end: drain by SIGTERM, a port freed by kill -9, addresses in use; nodes that leave and come back."""

import contextlib
import os
import select
import signal
import subprocess
import unittest

from support.processes import TCPHUB, Hub, Process, run_gimnet, start_gimnet, start_recv
from support.tap import Tap
from support.waiting import PATIENCE_S, wait_until
from support.wire import Client, Closed


@contextlib.contextmanager
def hangup(action):
    """What a program that is started meanwhile does at SIGHUP, unless it says otherwise."""
    before = signal.signal(signal.SIGHUP, action)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


class Ends(unittest.TestCase):
    def test_sigterm_tells_everybody_and_writes_what_waits(self):
        hub = Hub(self, shards=2)
        receiver = Client(self, hub).join("B", shard=0)
        sender = Client(self, hub).join(shard=1)
        for number in range(1000):
            sender.send(sender.frame(receiver.id, number.to_bytes(4, "little")))
        wait_until(lambda: hub.counter("accepted") == sender.frames_sent, "the hub took all of them")
        hub.process.signal(signal.SIGTERM)
        frames = receiver.until_closed()
        data = [frame.payload for frame in frames if frame.src == sender.id]
        self.assertEqual(data, [number.to_bytes(4, "little") for number in range(1000)])
        self.assertEqual([frame.goodbye for frame in frames if frame.goodbye], ["draining"])
        self.assertEqual(sender.goodbye(), "draining")
        self.assertEqual(hub.process.wait(), 0, hub.process.err)
        self.assertFalse(os.path.exists(hub.socket_path))

    def test_who_reads_late_hears_goodbye(self):
        hub = Hub(self, "--limit", "farewell_ms=60000", shards=2)
        late = [Client(self, hub).join(shard=shard) for shard in (0, 1)]
        hub.process.signal(signal.SIGTERM)
        for client in late:
            self.assertTrue(select.select([client.socket], [], [], PATIENCE_S)[0], "a GOODBYE")
            client.send(bytes(1000))  # it was on its way
        for client in late:
            self.assertIsNone(hub.process.popen.poll())
            self.assertEqual(client.goodbye(), "draining")
            client.socket.close()
        self.assertEqual(hub.process.wait(), 0, hub.process.err)

    def test_sigint_too(self):
        hub = Hub(self)
        hub.process.signal(signal.SIGINT)
        self.assertEqual(hub.process.wait(), 0, hub.process.err)

    def test_newcomers_are_refused_while_it_drains(self):
        hub = Hub(self)
        slow = Client(self, hub, receive_bytes=4096).join("slow")
        sender = Client(self, hub).join()
        for _ in range(25):
            sender.send(sender.frame(slow.id, bytes(60000), lane=2))
        wait_until(lambda: hub.counter("accepted") == sender.frames_sent == 25, "frames that wait")
        self.assertGreater(hub.quiet_status(self)["ledger"]["queued"], 0)
        hub.process.signal(signal.SIGTERM)
        self.assertEqual(sender.goodbye(), "draining")
        with self.assertRaises((ConnectionError, Closed, AssertionError)):
            Client(self, hub).join("late")
        slow.socket.close()
        self.assertEqual(hub.process.wait(), 0, hub.process.err)

    def test_a_port_freed_by_kill_9_can_be_bound(self):
        first = Hub(self)
        client = Client(self, first).join("B")
        first.process.signal(signal.SIGKILL)
        first.process.wait()
        self.assertTrue(os.path.exists(first.socket_path))
        second = Hub(self, listen=[first.url, f"unix:{first.socket_path}"])
        self.assertEqual(second.url, first.url)
        client.socket.close()
        self.assertEqual(run_gimnet(f"unix:{first.socket_path}", "nodes").code, 0)

    def test_an_address_in_use_is_named(self):
        hub = Hub(self)
        for address in hub.addresses:
            second = Process([TCPHUB, "--listen", address])
            self.addCleanup(second.end)
            self.assertEqual(second.wait(), 1)
            self.assertIn(address, second.err)
            self.assertIn("in use", second.err)
        self.assertEqual(run_gimnet(hub, "nodes").code, 0)

    def test_a_foreign_file_is_not_replaced(self):
        hub = Hub(self)
        path = hub.socket_path + ".txt"
        with open(path, "w", encoding="utf-8") as file:
            file.write("precious")
        second = Process([TCPHUB, "--listen", f"unix:{path}"])
        self.addCleanup(second.end)
        self.assertEqual(second.wait(), 1)
        self.assertIn(path, second.err)
        with open(path, encoding="utf-8") as file:
            self.assertEqual(file.read(), "precious")


class Nodes(unittest.TestCase):
    def test_ctrl_c_leaves_at_once(self):
        hub = Hub(self, "--limit", "grace_ms=600000")
        for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)):
            with hangup(signal.SIG_DFL):
                receiver = start_recv(self, hub, "B")
            receiver.signal(number)
            self.assertEqual(receiver.wait(), code)
            wait_until(lambda: not any(node["name"] for node in hub.nodes()), "B, given back long before its grace time")

    def test_a_terminal_that_goes_is_no_reason_to_end_where_that_was_ignored(self):
        hub = Hub(self)
        with hangup(signal.SIG_IGN):  # as nohup does
            receiver = start_recv(self, hub, "B", "-n", "1")
        receiver.signal(signal.SIGHUP)
        self.assertEqual(run_gimnet(hub, "send", "B", data=b"still there\n").code, 0)
        self.assertEqual((receiver.wait(), receiver.out), (0, b"still there\n"), receiver.err)

    def test_a_killed_node_keeps_its_name_for_the_grace_time(self):
        hub = Hub(self, "--limit", "grace_ms=500")
        receiver = start_recv(self, hub, "B")
        receiver.signal(signal.SIGKILL)
        receiver.wait()
        wait_until(lambda: any(not node["connected"] for node in hub.nodes() if node["name"] == "B") or
                   not any(node["name"] == "B" for node in hub.nodes()), "B away")
        wait_until(lambda: not any(node["name"] == "B" for node in hub.nodes()), "B forgotten")

    def test_a_token_brings_name_and_id_back(self):
        hub = Hub(self)
        first = Client(self, hub).join("B")
        first.socket.close()
        wait_until(lambda: any(not node["connected"] for node in hub.nodes()), "B away")
        again = Client(self, hub).join("B", token=first.welcome[2])
        self.assertEqual(again.id, first.id)
        third = Client(self, hub).join("B", token=again.welcome[2])
        self.assertEqual(third.id, first.id)
        self.assertEqual(again.goodbye(), "replaced")

    def test_recv_comes_back_after_the_hub_did(self):
        first = Hub(self)
        receiver = start_recv(self, first, "B", "-n", "1")
        first.process.signal(signal.SIGKILL)
        first.process.wait()
        wait_until(lambda: "connect again" in receiver.err, "the words that it tries")
        second = Hub(self, listen=[first.url])
        second.wait_for_node("B")
        tap = Tap(self, second)
        self.assertEqual(run_gimnet(tap, "send", "B", data=b"hello\n").code, 0)
        self.assertEqual(receiver.wait(), 0)
        self.assertEqual(receiver.out, b"hello\n")
        # What the sender sent went to the receiver, and the other way round.
        second.expect_ledger(self, accepted=lambda: tap.sent() + tap.got(), delivered=lambda: tap.sent() + tap.got())

    def test_a_silent_newcomer_does_not_stay(self):
        hub = Hub(self, "--limit", "handshake_ms=200")
        self.assertEqual(Client(self, hub).first_answer().goodbye, "hello_timeout")

    def test_echo_says_that_it_waits(self):
        hub = Hub(self)
        waiting = start_gimnet(self, hub, "echo", "a/b")
        wait_until(lambda: "nobody provides a/b yet" in waiting.err, "the words that it waits")


class StandsStill(unittest.TestCase):
    def test_send_says_for_whom_it_waits(self):
        hub = Hub(self, "--limit", "silent_ms=600000")
        receiver = start_recv(self, hub, "B", "-n", "2")
        receiver.signal(signal.SIGSTOP)
        sender = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE).feed(b"one\ntwo\n")
        wait_until(lambda: "waiting for B to acknowledge 2 messages" in sender.err, f"the words; it said: {sender.err}")
        receiver.signal(signal.SIGCONT)
        self.assertEqual((sender.wait(), receiver.wait()), (0, 0), sender.err)


class Killed(unittest.TestCase):
    def test_a_publisher_goes_on_with_its_next_line(self):
        hub = Hub(self)
        reader = start_gimnet(self, hub, "echo", "robot/odom", "--raw")
        pub = start_gimnet(self, hub, "pub", "robot/odom", "--rate", "200", "--wait", "1", stdin=subprocess.PIPE)
        pub.feed(b"".join(b"%d\n" % number for number in range(1, 100_000)))
        for _ in range(2):
            seen = len(reader.out)
            wait_until(lambda seen=seen: len(reader.out) > seen + 100, f"lines; pub said: {pub.err}")
            hub.process.signal(signal.SIGKILL)
            hub.process.wait()
            hub = hub.again(self)
        wait_until(lambda: pub.err.count("connected again") == 2, f"its return; it said: {pub.err}")
        pub.signal(signal.SIGINT)
        self.assertEqual(pub.wait(), 130, pub.err)
        numbers = [int(line) for line in reader.out.split()]
        self.assertEqual(numbers, sorted(set(numbers)))

    def test_a_publisher_whose_hub_is_back_ends_well(self):
        hub = Hub(self)
        reader = start_gimnet(self, hub, "echo", "robot/odom", "--raw")
        pub = start_gimnet(self, hub, "pub", "robot/odom", "--rate", "500", "--wait", "1", stdin=subprocess.PIPE)
        pub.feed(b"".join(b"%d\n" % number for number in range(1, 1000)))
        wait_until(lambda: len(reader.out) > 100, f"lines; pub said: {pub.err}")
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        hub.again(self)
        self.assertEqual(pub.wait(), 0, pub.err)
        self.assertNotIn("is the hub running there?", pub.err.splitlines()[-1])
        wait_until(lambda: reader.out.endswith(b"\n999\n"), f"the last line; it said: {reader.err}")


if __name__ == "__main__":
    unittest.main()
