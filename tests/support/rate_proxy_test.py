#!/usr/bin/env python3
"""The rate-limiting proxy: what comes out, no faster than its rate, with little held; and cutting."""

import socket
import threading
import time
import unittest

from rate_proxy import Allowance, RateProxy

PATIENCE_S = 20


class Echo:
    """A server that sends back what it gets."""

    def __init__(self, test):
        self.listener = socket.socket()
        self.listener.bind(("127.0.0.1", 0))
        self.listener.listen(16)
        self.port = self.listener.getsockname()[1]
        test.addCleanup(self.listener.close)
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                peer, _ = self.listener.accept()
            except OSError:
                return
            threading.Thread(target=self._answer, args=(peer,), daemon=True).start()

    @staticmethod
    def _answer(peer):
        with peer:
            try:
                while data := peer.recv(65536):
                    peer.sendall(data)
            except OSError:
                pass


class RateProxyTest(unittest.TestCase):
    def proxy(self, **rates):
        proxy = RateProxy(Echo(self).port, **rates)
        self.addCleanup(proxy.close)
        return proxy

    def dial(self, proxy):
        client = socket.create_connection(("127.0.0.1", proxy.port), timeout=PATIENCE_S)
        self.addCleanup(client.close)
        return client

    def take(self, client, size):
        data = b""
        while len(data) < size:
            more = client.recv(size - len(data))
            self.assertTrue(more, "it closed too early")
            data += more
        return data

    def test_forwards_both_ways(self):
        proxy = self.proxy()
        client = self.dial(proxy)
        sent = bytes(range(256)) * 40
        client.sendall(sent)
        self.assertEqual(self.take(client, len(sent)), sent)
        self.assertEqual((proxy.accepted, proxy.up_bytes, proxy.down_bytes), (1, len(sent), len(sent)))

    def test_is_never_faster_than_its_rate(self):
        proxy = self.proxy(down_bits_per_s=800_000)
        client = self.dial(proxy)
        begin = time.monotonic()
        client.sendall(bytes(50_000))
        self.take(client, 50_000)
        self.assertGreaterEqual(time.monotonic() - begin, 0.45, "50,000 bytes at 100,000 a second")

    def test_lets_through_what_is_granted_and_saves_nothing_up(self):
        allowance = Allowance()
        proxy = self.proxy(down=allowance)
        client = self.dial(proxy)
        client.sendall(b"a" * 500)
        self.assertEqual(self.take(client, 500), b"a" * 500, "anything, before it is bound")
        allowance.bound()
        allowance.grant(5000)  # void with the next: nobody wanted it
        allowance.grant(30)
        client.sendall(b"b" * 100)
        with allowance.news:
            self.assertTrue(allowance.news.wait_for(lambda: allowance.used_up, PATIENCE_S))
        self.assertEqual(proxy.down_bytes, 500)
        for _ in range(2):
            allowance.grant(35)
        self.assertEqual(self.take(client, 100), b"b" * 100, "30, 35 and 35")
        allowance.lift()
        client.sendall(b"c" * 700)
        self.assertEqual(self.take(client, 700), b"c" * 700)

    def test_holds_little(self):
        proxy = self.proxy(down_bits_per_s=8)
        client = self.dial(proxy)
        client.settimeout(0.2)
        sent = 0
        with self.assertRaises(TimeoutError):
            while sent < 50_000_000:
                sent += client.send(bytes(65536))
        self.assertLess(sent, 20_000_000, "what does not pass is not swallowed")

    def test_cut_ends_what_is_open_and_takes_the_next(self):
        proxy = self.proxy()
        first = self.dial(proxy)
        first.sendall(b"x")
        self.take(first, 1)
        self.assertEqual(proxy.cut(), 1)
        try:
            self.assertEqual(first.recv(1), b"")
        except ConnectionResetError:
            pass
        second = self.dial(proxy)
        second.sendall(b"y")
        self.assertEqual(self.take(second, 1), b"y")
        self.assertEqual(proxy.accepted, 2)


if __name__ == "__main__":
    unittest.main()
