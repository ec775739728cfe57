#!/usr/bin/env python3
"""A provider at 200 messages a second, and three subscribers whose ways carry 10, 1 and 0.1 Mbit/s: each gets the newest at its
own rate. The clock is what the ways let through: with each message the proxies are granted what those rates carry in a
200th of a second, and the next message comes when all of it was used, or nothing newer is there. So nothing here depends on
how fast the machine is. And subscribers that change their maximal rate."""

import bisect
import os
import pathlib
import struct
import sys
import threading
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

from rate_proxy import Allowance, RateProxy
from support.delivery import LATEST_DELIVERY, STREAM_DELIVERY, SYNC_DELIVERY, Provider, subscribe, subscription
from support.processes import Hub
from support.waiting import PATIENCE_S
from support.wire import CREDIT, FLOW, GROUP, HEADER, NS, PONG, Client, Closed, control, text

FULL = os.environ.get("GIMNET_STRESS") == "full"
MESSAGES_PER_S = 200
RATES_BITS_PER_S = (10e6, 1e6, 1e5)
SIZE = 1000
FRAME = HEADER + 20 + SIZE  # key and header of GIMI
# What has left the hub's queue and not passed the proxy, at most: the small buffers of the kernel between the two, as the
# kernel counts them, which is twice what was asked for at either end, a frame that overhangs them, and a piece in the proxy.
HELD_BYTES = 24 * 1024
# The hub gives nobody up who is slow by its clock, and the kernel little to hold.
ARGUMENTS = ("--limit", "silent_ms=3000000", "--limit", "keep_alive_ms=600000", "--limit", "slow_consumer_ms=3000000",
             "--limit", "socket_send_bytes=4096")


class CountingClient(Client):
    """Knows how many bytes of its connection it has read: the unit of RateProxy.down_bytes."""
    read_bytes = 0

    def _take(self, size):
        taken = super()._take(size)
        self.read_bytes += size
        return taken


class Subscriber:
    """Takes what comes in a thread of its own; with `credits` it says that it took each message before it takes the next."""

    def __init__(self, test, way, provider, credits, shard, news):
        self.client = CountingClient(test, way, receive_bytes=4096).join(shard=shard)
        self.answer = subscribe(self.client, "A/B")
        self.group, self.credits, self.news = provider.group, credits, news
        self.got = []         # sequences
        self.ends = []        # bytes read when they had come
        self.stale = []       # what was older than it may be by the hub's word
        self.seen_by_hub = 0  # sequence of a message that the hub has handled
        self.fresh = 0        # ... when the last CREDIT was sent: what comes next is not older
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        try:
            while True:
                got = self.client.next_where(lambda frame: frame.kind == GROUP)
                self._note(struct.unpack_from("<I", got.payload, 12)[0])
                if self.credits:
                    credit = struct.pack("<B3xIQ", CREDIT, self.group, len(self.got))
                    self.client.send(self.client.frame(0, credit, kind=FLOW))
        except (Closed, OSError):
            pass

    def _note(self, sequence):
        with self.news:
            if self.credits and sequence < self.fresh:
                self.stale.append((sequence, self.fresh))
            self.got.append(sequence)
            self.ends.append(self.client.read_bytes)
            self.fresh = self.seen_by_hub
            self.news.notify_all()

    def has(self, sequence):
        return bool(self.got) and self.got[-1] >= sequence


class Way:
    """A way of a given rate, and the subscriber behind it."""

    def __init__(self, test, hub, rate_bits_per_s, provider, credits, shard):
        self.per_message = rate_bits_per_s / 8 / MESSAGES_PER_S
        self.allowance = Allowance()
        self.proxy = RateProxy(hub.port, down=self.allowance)
        test.addCleanup(self.proxy.close)
        self.subscriber = Subscriber(test, self.proxy, provider, credits, shard, self.allowance.news)
        self.allowance.bound()
        self.passed, self.newest = [], []  # what had passed when which message was the newest at the hub

    def carry(self, newest):
        """Lets through what goes while one message is the newest. False: less came than there was room for."""
        self.passed.append(self.proxy.down_bytes)
        self.newest.append(newest)
        self.subscriber.seen_by_hub = newest
        self.allowance.grant(self.per_message)
        with self.allowance.news:
            return self.allowance.news.wait_for(lambda: self.allowance.used_up or self.subscriber.has(newest), PATIENCE_S)

    def judged(self):
        """(sequence, the oldest that it may be) of each message. What was at the hub when the way had let through all that
        the buffers could hold before this message, and the message, was there to be sent in its place."""
        for sequence, end in zip(self.subscriber.got, self.subscriber.ends):
            at = bisect.bisect_right(self.passed, end - FRAME - HELD_BYTES)
            if at:
                yield sequence, self.newest[at - 1]


class Rates(unittest.TestCase):
    def run_rates(self, delivery, window, shards, count):
        """Its ways, the slowest last, when each has the newest message."""
        hub = Hub(self, *ARGUMENTS, shards=shards)
        provider = Provider(self, hub, delivery, window)
        credits = window is not None
        ways = [Way(self, hub, rate, provider, credits, shards - 1) for rate in RATES_BITS_PER_S]
        # On the subscribers' shard, subscribed behind them: what it has, that shard has for all of them.
        witness = Subscriber(self, hub, provider, credits, shards - 1, threading.Condition())
        for _ in range(count):
            sequence = provider.publish(SIZE)
            with witness.news:
                self.assertTrue(witness.news.wait_for(lambda: witness.has(sequence), PATIENCE_S), "the witness waits in vain")
            for way in ways:
                self.assertTrue(way.carry(sequence), "the way had room, and the subscriber did not get the newest")
        for way in ways:
            begin = way.proxy.down_bytes
            while not way.subscriber.has(count):
                self.assertTrue(way.carry(count), "the way had room, and the subscriber did not get the newest")
                self.assertLessEqual(way.proxy.down_bytes - begin, HELD_BYTES + 2 * FRAME, "what is older goes first")
        self.look_at_all(hub, ways, [way.subscriber for way in ways] + [witness], count)
        return ways

    def look_at_all(self, hub, ways, subscribers, count):
        for each in subscribers:
            self.assertEqual(each.got, sorted(set(each.got)), "in order, and once")
        self.assertEqual(subscribers[0].got, list(range(1, count + 1)), "the fast one gets every one")
        carried = int(count * ways[-1].per_message) // FRAME
        self.assertLess(len(subscribers[2].got), carried + HELD_BYTES // FRAME + 4, "no more than its way carries")
        self.assertGreaterEqual(len(subscribers[2].got), carried - 1, "and no less")
        got = sum(len(each.got) for each in subscribers)
        # Each message came or was replaced.
        hub.expect_ledger(self, accepted=count, copies=(len(subscribers) - 1) * count, delivered=got,
                          dropped={"replaced": len(subscribers) * count - got})

    def test_sync_gives_each_the_newest_at_its_own_rate(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                for way in self.run_rates(SYNC_DELIVERY, 1, shards, 2000 if FULL else 400):
                    self.assertEqual(way.subscriber.answer[10], 1, "the window in force")
                    self.assertEqual(way.subscriber.stale, [], "what it got was older than what its hub had when it credited")

    def test_latest_gives_each_the_newest_at_its_own_rate(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                for way in self.run_rates(LATEST_DELIVERY, None, shards, 5000 if FULL else 1000):
                    judged = list(way.judged())
                    self.assertGreater(len(judged), 20, "what the buffers hold is not judged")
                    stale = [(sequence, oldest) for sequence, oldest in judged if sequence < oldest]
                    self.assertEqual(stale, [], "it got what was older than the newest when the way had room for it")


class ChangedRates(unittest.TestCase):
    SELDOM_HZ, OFTEN_HZ = 0.001, 1000.0

    def setUp(self):
        hub = Hub(self, *ARGUMENTS, shards=1)
        self.provider = Provider(self, hub, STREAM_DELIVERY)
        self.client = Client(self, hub).join("C", shard=0)

    def publish(self):
        """The hub has handled it when this returns."""
        sequence = self.provider.publish()
        self.provider.client.ping(sequence)
        self.provider.client.next_where(lambda got: got.kind == FLOW and got.payload[0] == PONG)
        return sequence

    def expect(self, sequence):
        self.assertEqual(struct.unpack_from("<I", self.client.next_data().payload, 12)[0], sequence)

    def test_a_higher_rate_is_in_force_at_once(self):
        subscribe(self.client, "A/B", rate_hz=self.SELDOM_HZ)
        self.expect(self.publish())
        held = self.publish()
        # It may come before the answer.
        self.client.send(self.client.frame(0, control(10, subscription("A/B", rate_hz=self.OFTEN_HZ), 2), kind=NS))
        self.expect(held)
        self.expect(self.publish())

    def test_a_subscription_that_begins_again_begins_at_once(self):
        subscribe(self.client, "A/B", rate_hz=self.SELDOM_HZ)
        self.expect(self.publish())
        self.publish()
        self.client.ask(NS, 11, text(3, "A/B"))
        subscribe(self.client, "A/B", rate_hz=self.SELDOM_HZ)
        self.expect(self.publish())


if __name__ == "__main__":
    unittest.main()
