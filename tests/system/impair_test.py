#!/usr/bin/env python3
"""`gimnet impair`: a hub behind a bad network, and the orders that change the network while it runs."""

import json
import subprocess
import tempfile
import time
import unittest

from support.processes import BIN, Hub, Process, run_gimnet, start_gimnet, start_recv
from support.waiting import wait_until

USAGE = 2
SLOW_FILE = 20 << 20  # five seconds at 4 MB/s


class Behind(unittest.TestCase):
    """Nodes that reach the hub through the proxy."""

    def setUp(self):
        self.hub = Hub(self)

    def impair(self, *words):
        proxy = Process([str(BIN / "gimnet"), "impair", "tcp://127.0.0.1:0", self.hub.url, *words],
                        stdin=subprocess.PIPE)
        self.addCleanup(proxy.end)
        wait_until(lambda: proxy.out.count(b"\n") == 1, f"the ready line; it said: {proxy.err}")
        word, url = proxy.out.decode().split()
        self.assertEqual(word, "ready")
        self.proxy, self.answers = proxy, 1
        return url

    def order(self, line):
        self.proxy.popen.stdin.write(line.encode() + b"\n")
        self.proxy.popen.stdin.flush()
        self.answers += 1
        wait_until(lambda: self.proxy.out.count(b"\n") == self.answers, f"the answer to {line!r}")
        return self.proxy.out.decode().splitlines()[-1]

    def test_a_round_trip_has_the_delay_of_both_ways(self):
        start_recv(self, self.hub, "B")
        url = self.impair("--delay", "20ms")
        ping = run_gimnet(url, "ping", "B", "-c", "3", "-i", "0", "--json")
        self.assertGreaterEqual(json.loads(ping.out)["min"], 40_000, ping.err)
        self.assertEqual(self.order("delay off"), "ok")
        ping = run_gimnet(url, "ping", "B", "-c", "20", "-i", "0", "--json")
        self.assertLess(json.loads(ping.out)["min"], 40_000, ping.err)

    def test_every_byte_arrives_in_pieces_of_one_to_seven(self):
        receiver = start_recv(self, self.hub, "B", "--raw", "-n", "200")
        url = self.impair("--split", "7", "--jitter", "1ms")
        lines = b"".join(b"line %d of two hundred\n" % i for i in range(200))
        self.assertEqual(run_gimnet(url, "send", "B", data=lines).code, 0)
        self.assertEqual((receiver.wait(), receiver.out), (0, lines))

    def test_a_file_on_its_way_is_not_said_to_wait_for_its_acknowledgement(self):
        start_recv(self, self.hub, "B", "-n", "1", "--max-size", str(SLOW_FILE))
        url = self.impair("--rate", "4MB")
        with tempfile.NamedTemporaryFile() as file:
            file.write(bytes(SLOW_FILE))
            file.flush()
            begin = time.monotonic()
            send = run_gimnet(url, "send", "B", "--file", file.name)
        self.assertEqual((send.code, send.err), (0, ""))
        self.assertGreater(time.monotonic() - begin, 4, "longer than `gimnet send` waits without a word")

    def test_a_cut_resumes_the_session_and_loses_nothing(self):
        url = self.impair("--delay", "1ms")
        receiver = start_gimnet(self, url, "recv", "--name", "B", "--raw", "-n", "300")
        self.hub.wait_for_node("B")
        sender = start_gimnet(self, self.hub, "send", "B", stdin=subprocess.PIPE)
        for part in range(3):
            sender.popen.stdin.write(b"".join(b"%d\n" % i for i in range(100 * part, 100 * part + 100)))
            sender.popen.stdin.flush()
            wait_until(lambda: receiver.out.count(b"\n") == 100 * part + 100, "a hundred lines")
            if part < 2:  # then the receiver leaves, and a cut may take its last acknowledgements along
                self.assertEqual(self.order("cut"), "ok")
        sender.popen.stdin.close()
        self.assertEqual((receiver.wait(), sender.wait()), (0, 0), receiver.err + sender.err)
        self.assertEqual(receiver.out, b"".join(b"%d\n" % i for i in range(300)))
        self.assertGreaterEqual(json.loads(self.order("status"))["cut"], 2)

    def test_a_wrong_order_is_told_and_changes_nothing(self):
        url = self.impair()
        self.assertIn("error: there is no setting 'dealy'", self.order("dealy 80ms"))
        self.assertEqual(run_gimnet(url, "nodes").code, 0)
        self.assertEqual(self.order("refuse"), "ok")
        self.assertEqual(run_gimnet(url, "nodes").code, 3)
        self.assertEqual(self.order("accept"), "ok")
        self.assertEqual(run_gimnet(url, "nodes").code, 0)

    def test_it_goes_on_without_orders_until_a_signal(self):
        url = self.impair()
        self.proxy.popen.stdin.close()
        self.assertEqual(run_gimnet(url, "nodes").code, 0)
        self.proxy.signal(15)
        self.assertEqual(self.proxy.wait(), 143)


class Arguments(unittest.TestCase):
    def test_what_is_wrong_is_named(self):
        for words, part in ((("127.0.0.1:1", "tcp://127.0.0.1:2"), "'127.0.0.1:1': the scheme is unknown"),
                            (("tcp://127.0.0.1:0", "tcp://host"), "'tcp://host': the port is missing"),
                            (("tcp://127.0.0.1:0", "unix:x", "--delay", "80"), "'80' is no value for --delay"),
                            (("unix:/x", "unix:/x"), "cannot relay unix:/x to itself: listen on another port or path"),
                            (("tcp://127.0.0.1:0",), "target is missing")):
            with self.subTest(words=words):
                ended = subprocess.run([str(BIN / "gimnet"), "impair", *words], capture_output=True, text=True,
                                       timeout=20, stdin=subprocess.DEVNULL)
                self.assertEqual(ended.returncode, USAGE, ended.stderr)
                self.assertIn(part, ended.stderr)

    def test_an_address_in_use_is_told(self):
        hub = Hub(self)
        ended = subprocess.run([str(BIN / "gimnet"), "impair", hub.url, "unix:/x"], capture_output=True, text=True,
                               timeout=20, stdin=subprocess.DEVNULL)
        self.assertEqual(ended.returncode, 1)
        self.assertIn("Address already in use", ended.stderr)


if __name__ == "__main__":
    unittest.main()
