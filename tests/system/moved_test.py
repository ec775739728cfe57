#!/usr/bin/env python3
"""Services that change while a subscriber's connection is cut: at its return it is told what they are now, before the first
message of them. A service keeps its group id while its terms are the same, whoever provides it."""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from support.delivery import LATEST_DELIVERY, STREAM_DELIVERY, Provider, advertise, subscribe
from support.processes import Hub
from support.waiting import wait_until
from support.wire import GOODBYE, GROUP, LINK, NS, Client, control, number, value

SERVICE_MOVED = 32
WITHDRAW = 8
EPOCH = 77


def is_away(hub, name):
    return any(node["name"] == name and not node["connected"] for node in hub.nodes())


class Subscriber:
    """Of `A/B`, with resume; comes back with its token and its counts."""

    def __init__(self, test, hub):
        self.test, self.hub, self.taken = test, hub, 0
        self.client = Client(test, hub).join("S", extra=self._resume())
        subscribe(self.client, "A/B")

    @staticmethod
    def _resume(epoch=None, taken=0):
        extra = number(4, 5, EPOCH) + value(5, 1, b"\1")
        if epoch is not None:
            extra += number(9, 5, epoch) + number(10, 5, taken)
        return extra

    def cut(self):
        self.client.socket.close()
        wait_until(lambda: is_away(self.hub, "S"), "the hub sees the cut")

    def come_back(self):
        before = self.client.welcome
        self.client = Client(self.test, self.hub).join("S", token=before[2], extra=self._resume(before[5], self.taken))
        self.test.assertTrue(self.client.welcome.get(11), "resumed")

    def next(self):
        """The next message or SERVICE_MOVED."""
        got = self.client.next_where(lambda each: each.kind == GROUP or (each.kind == NS and each.operation == SERVICE_MOVED))
        self.taken += got.kind == GROUP
        return got

    def expect_moved(self, group, provider):
        got = self.next()
        self.test.assertEqual((got.kind, got.fields[4], got.fields.get(5, 0)), (NS, group, provider))


def move(provider, delivery):
    """The service is withdrawn and comes back on those terms."""
    withdraw(provider)
    provider.group = advertise(provider.client, "B", delivery)[3]
    return provider.group


def withdraw(provider):
    assert provider.client.ask(NS, WITHDRAW, number(3, 4, provider.group))[1] == 0


class Moved(unittest.TestCase):
    @staticmethod
    def waiting(hub):
        return hub.status()["ledger"]["queued"]

    def test_by_other_terms_while_the_subscriber_was_away(self):
        for shards in (1, 2):
            for moves in (1, 2, 7):
                with self.subTest(shards=shards, moves=moves):
                    hub = Hub(self, shards=shards)
                    provider = Provider(self, hub, STREAM_DELIVERY)
                    subscriber = Subscriber(self, hub)
                    groups = [provider.group]
                    subscriber.cut()
                    provider.publish()
                    for place in range(moves):
                        # A frame that still crosses shards when its group goes is dropped.
                        wait_until(lambda: self.waiting(hub) == place + 1, "the message at the subscriber's shard")
                        groups.append(move(provider, STREAM_DELIVERY if place % 2 else LATEST_DELIVERY))
                        provider.publish()
                    self.assertEqual(len(set(groups)), moves + 1, "other terms have another group, also for the second time")
                    wait_until(lambda: self.waiting(hub) == moves + 1, "they wait at the hub")
                    subscriber.come_back()
                    subscriber.expect_moved(groups[-1], provider.client.id)
                    self.assertEqual([subscriber.next().dst for _ in groups], groups)
                    self.assertEqual(subscribe(subscriber.client, "A/B")[4], groups[-1])

    def test_to_another_session_of_its_provider(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                hub = Hub(self, shards=shards)
                provider = Provider(self, hub, STREAM_DELIVERY)
                subscriber = Subscriber(self, hub)
                before = subscribe(subscriber.client, "A/B")
                provider.client.send(provider.client.frame(0, control(GOODBYE, number(1, 3, 0)), kind=LINK))
                subscriber.expect_moved(provider.group, 0)
                provider = Provider(self, hub, STREAM_DELIVERY)
                self.assertEqual(provider.group, before[4], "the group stays")
                subscriber.expect_moved(provider.group, provider.client.id)
                self.assertNotEqual(subscribe(subscriber.client, "A/B")[6], before[6], "another session")
                provider.publish()
                self.assertEqual(subscriber.next().dst, provider.group)

    def test_where_the_event_was_lost_with_the_connection(self):
        hub = Hub(self)
        provider = Provider(self, hub, STREAM_DELIVERY)
        subscriber = Subscriber(self, hub)
        for delivery in (LATEST_DELIVERY, STREAM_DELIVERY, LATEST_DELIVERY):
            group = move(provider, delivery)  # told on a connection that breaks before it is read
            subscriber.cut()
            provider.publish()
            subscriber.come_back()
            subscriber.expect_moved(group, provider.client.id)
            self.assertEqual(subscriber.next().dst, group)

    def test_a_service_that_is_gone(self):
        hub = Hub(self)
        provider = Provider(self, hub, STREAM_DELIVERY)
        subscriber = Subscriber(self, hub)
        subscriber.cut()
        provider.publish()
        withdraw(provider)
        subscriber.come_back()
        subscriber.expect_moved(provider.group, 0)
        self.assertEqual(subscriber.next().dst, provider.group)


if __name__ == "__main__":
    unittest.main()
