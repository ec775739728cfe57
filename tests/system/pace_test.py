#!/usr/bin/env python3
"""Delivery of services to subscribers of very different speed, behind a proxy that bounds it: sync(1), latest, windows
that must not leak, and the last message for who comes late. Judged by counts and sequence numbers, not by time."""

import os
import pathlib
import struct
import sys
import threading
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

from rate_proxy import RateProxy
from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import PATIENCE_S, wait_until
from support.wire import (CREDIT, FLAG_KEYED, FLOW, GROUP, LATEST, NS, Client, Closed, number, text, value)

FULL = os.environ.get("GIMNET_STRESS") == "full"
STREAM_DELIVERY, LATEST_DELIVERY, SYNC_DELIVERY = range(3)
SIZE = 1000


def advertise(client, name, delivery, window=None, retain=False):
    body = text(3, name) + number(7, 2, delivery)
    if window is not None:
        body += number(10, 4, window)
    if retain:
        body += value(11, 1, b"\1")
    return client.ask(NS, 7, body)


def subscribe(client, name, **pace):
    body = text(3, name)
    if "window" in pace:
        body += number(4, 4, pace["window"])
    if "depth" in pace:
        body += number(5, 4, pace["depth"])
    if "rate_hz" in pace:
        body += value(6, 11, struct.pack("<d", pace["rate_hz"]))
    return client.ask(NS, 10, body)


def message(sequence, content=b""):
    """A DATA message of GIMI with key 0."""
    return bytes(8) + struct.pack("<IBBH", sequence, 0, 0, 0) + content


class Provider:
    """Publishes numbered messages of a service, one when it is told to."""

    def __init__(self, test, hub, delivery, window=None, retain=False):
        self.client = Client(test, hub).join("A", shard=0)
        self.group = advertise(self.client, "B", delivery, window, retain)[3]
        self.flags = FLAG_KEYED | (LATEST if delivery == LATEST_DELIVERY else 0)
        self.sequence = 0

    def publish(self, size=SIZE):
        self.sequence += 1
        content = b"%d" % self.sequence
        payload = message(self.sequence, content + b"." * (size - len(content)))
        self.client.send(self.client.frame(self.group, payload, kind=GROUP, flags=self.flags))
        return self.sequence


class Subscriber:
    """Counts what comes; with `credits` it says that it took each message before it takes the next."""

    def __init__(self, test, proxy, provider, credits, shard=0, **pace):
        self.client = Client(test, proxy, receive_bytes=4096).join(shard=shard)
        self.group, self.credits, self.provider = provider.group, credits, provider
        self.answer = subscribe(self.client, "A/B", **pace)
        self.got, self.stale = [], []
        self.news = threading.Condition()
        self.seen_by_hub = 0  # sequence of a message that the hub has handled
        self.fresh = 0        # ... when the last CREDIT was sent: what comes next is not older
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        try:
            while True:
                got = self.client.next_where(lambda frame: frame.kind == GROUP)
                sequence = struct.unpack_from("<I", got.payload, 8)[0]
                with self.news:
                    if self.credits and sequence < self.fresh:
                        self.stale.append((sequence, self.fresh))
                    self.got.append(sequence)
                    self.fresh = self.seen_by_hub
                    self.news.notify_all()
                self.client.ping()  # the hub's own may be far behind
                if self.credits:
                    total = len(self.got)
                    self.client.send(self.client.frame(0, struct.pack("<B3xIQ", CREDIT, self.group, total), kind=FLOW))
        except (Closed, OSError):
            pass

    def wait_for(self, sequence):
        with self.news:
            return self.news.wait_for(lambda: self.got and self.got[-1] >= sequence, PATIENCE_S)


class Rates(unittest.TestCase):
    """A provider, and three subscribers at 10, 1 and 0.1 Mbit/s, on its shard and on another."""

    def run_rates(self, delivery, window, shards):
        hub = Hub(self, shards=shards)
        provider = Provider(self, hub, delivery, window)
        proxies = [RateProxy(hub.port, down_bits_per_s=rate) for rate in (10e6, 1e6, 1e5)]
        for proxy in proxies:
            self.addCleanup(proxy.close)
        subscribers = [Subscriber(self, proxy, provider, window is not None, shard=shards - 1) for proxy in proxies]
        fast = subscribers[0]
        count = 1000 if FULL else 200
        for _ in range(count):
            sequence = provider.publish()
            # The next one only when the fast one has this: whether it gets every one does not depend on the machine.
            self.assertTrue(fast.wait_for(sequence), "the fast one waits in vain")
            for each in subscribers:
                each.seen_by_hub = sequence
        for each in subscribers:
            self.assertTrue(each.wait_for(count), "the newest has to arrive, however slow the way is")
            self.assertEqual(each.got, sorted(set(each.got)), "in order, and once")
        self.assertEqual(fast.got, list(range(1, count + 1)))
        self.assertLessEqual(len(subscribers[2].got), count)
        return subscribers

    def test_sync_gives_each_the_newest_at_its_own_rate(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                for each in self.run_rates(SYNC_DELIVERY, 1, shards):
                    self.assertEqual(each.answer[8], 1, "the window in force")
                    self.assertEqual(each.stale, [], "what it got was older than what its hub had when it credited")

    def test_latest_gives_each_the_newest_at_its_own_rate(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                self.run_rates(LATEST_DELIVERY, None, shards)


class Windows(unittest.TestCase):
    def test_a_window_of_less_and_a_depth(self):
        hub = Hub(self)
        provider = Provider(self, hub, SYNC_DELIVERY, 4)
        client = Client(self, hub).join()
        self.assertEqual(subscribe(client, "A/B", window=2, depth=3)[8], 2)
        for _ in range(9):
            provider.publish(10)

        def take():
            return struct.unpack_from("<I", client.next_where(lambda got: got.kind == GROUP).payload, 8)[0]

        self.assertEqual([take(), take()], [1, 2])
        wait_until(lambda: hub.counter("accepted") == 9, "all are at the hub")
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 2), kind=FLOW))
        self.assertEqual([take(), take()], [7, 8], "the newest three were held")
        # A lying total is what was sent, and one for an unknown group is nothing; both are counted.
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 1 << 60), kind=FLOW))
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group + 1, 1), kind=FLOW))
        self.assertEqual(take(), 9)
        wait_until(lambda: hub.counter("bad_credits") == 2, "two CREDITs that cannot be")
        provider.publish(10)
        self.assertEqual(take(), 10)
        provider.publish(10)
        provider.publish(10)
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 6), kind=FLOW))
        self.assertEqual([take(), take()], [11, 12])

    def test_numbers_out_of_range_are_refused_with_words(self):
        hub = Hub(self)
        client = Client(self, hub).join("A")
        for answer in (advertise(client, "B", SYNC_DELIVERY, 1025), subscribe(client, "X/Y", window=1025),
                       subscribe(client, "X/Y", depth=65), subscribe(client, "X/Y", depth=0),
                       subscribe(client, "X/Y", rate_hz=1000.5), subscribe(client, "X/Y", rate_hz=-1.0),
                       subscribe(client, "X/Y", rate_hz=float("nan"))):
            self.assertEqual(answer[1], 6, answer)
            self.assertIn("must be", answer[2])
        self.assertEqual(advertise(client, "B", STREAM_DELIVERY, 2)[1], 2)
        self.assertEqual(client.ask(NS, 7, text(3, "B") + number(7, 2, 3))[1], 2)
        self.assertEqual(advertise(client, "B", SYNC_DELIVERY, 1024)[1], 0)
        self.assertEqual(subscribe(client, "X/Y", window=1024, depth=64, rate_hz=1000.0)[1], 0)

    def test_no_window_leaks_when_the_connection_flaps(self):
        """`gimnet echo` behind a proxy that cuts, of a provider that never stops."""
        hub = Hub(self, shards=2)
        provider = Provider(self, hub, SYNC_DELIVERY, 1)
        proxy = RateProxy(hub.port)
        self.addCleanup(proxy.close)
        echo = start_gimnet(self, proxy, "echo", "A/B", "--raw")
        wait_until(lambda: provider.publish() and echo.out_size > 0, "the first message")
        for _ in range(1000 if FULL else 30):
            before = (proxy.accepted, echo.out_size)
            wait_until(lambda: proxy.cut(), "a connection to cut", pause_s=0.001)
            provider.publish()

            def goes_on():
                provider.publish()
                return proxy.accepted > before[0] and echo.out_size > before[1]

            wait_until(goes_on, "messages after the cut")
        for _ in range(20):
            before = echo.out_size
            provider.publish()
            wait_until(lambda: echo.out_size > before, "one message, one window")
        self.assertEqual(hub.counter("bad_credits"), 0)


class Retained(unittest.TestCase):
    def test_a_late_subscriber_gets_the_last_first(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                hub = Hub(self, shards=shards)
                provider = Provider(self, hub, STREAM_DELIVERY, retain=True)
                for _ in range(5):
                    provider.publish(10)
                wait_until(lambda: hub.counter("accepted") == 5, "they are at the hub")
                late = run_gimnet(hub, "echo", "A/B", "-n", "1", "--raw")
                self.assertEqual((late.code, late.out), (0, b"5.........\n"), late.err)
                self.assertEqual(run_gimnet(hub, "echo", "A/B", "-n", "1", "--raw").out, b"5.........\n")


if __name__ == "__main__":
    unittest.main()
