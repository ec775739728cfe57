#!/usr/bin/env python3
"""Services that move while a subscriber's connection is cut: it is told of each group before the first message of it, also
where several groups came and went, and once only as news."""

import pathlib
import struct
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from support.delivery import STREAM_DELIVERY, Provider, advertise, subscribe
from support.processes import Hub
from support.waiting import wait_until
from support.wire import GROUP, NS, Client, number, text, value

SERVICE_MOVED = 32
WITHDRAW = 8
RESOLVE = 3
EPOCH = 77


def is_away(hub, name):
    return any(node["name"] == name and not node["connected"] for node in hub.nodes())


def repeated_numbers(payload, wanted):
    """All values (u32) of that key."""
    found, at = [], 4
    while at < len(payload):
        key = int.from_bytes(payload[at + 1:at + 4], "little")
        size_bytes = 1 << (payload[at] & 3)
        size = int.from_bytes(payload[at + 4:at + 4 + size_bytes], "little")
        at += 4 + size_bytes
        if key == wanted:
            found.append(struct.unpack_from("<I", payload, at)[0])
        at += size
    return found


class Subscriber:
    """Of `A/B`, with resume; comes back with its token and its counts."""

    def __init__(self, test, hub):
        self.test, self.hub, self.taken = test, hub, 0
        self.client = Client(test, hub).join("S", extra=self._resume())
        self.known = {subscribe(self.client, "A/B")[3]}

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
        """The next message or SERVICE_MOVED; each message is of a group that was told."""
        got = self.client.next_where(lambda each: each.kind == GROUP or (each.kind == NS and each.operation == SERVICE_MOVED))
        if got.kind == GROUP:
            self.taken += 1
            self.test.assertIn(got.dst, self.known, "a message of a group of which nobody told")
        else:
            self.known.update({got.fields[5], *repeated_numbers(got.payload, 12)})
        return got


def move(provider):
    """The service is withdrawn and comes back under another group."""
    assert provider.client.ask(NS, WITHDRAW, number(3, 4, provider.group))[1] == 0
    provider.group = advertise(provider.client, "B", STREAM_DELIVERY)[3]
    return provider.group


class Moved(unittest.TestCase):
    def test_while_the_subscriber_was_away(self):
        for shards in (1, 2):
            for moves in (1, 2, 7):
                with self.subTest(shards=shards, moves=moves):
                    hub = Hub(self, shards=shards)
                    provider = Provider(self, hub, STREAM_DELIVERY)
                    subscriber = Subscriber(self, hub)
                    groups = [provider.group]
                    subscriber.cut()
                    provider.publish()
                    for _ in range(moves):
                        groups.append(move(provider))
                        provider.publish()
                    wait_until(lambda: hub.counter("accepted") == moves + 1, "they wait at the hub")
                    subscriber.come_back()
                    event = subscriber.next()
                    self.assertEqual((event.kind, event.fields[4], event.fields[5]), (NS, groups[0], groups[-1]))
                    self.assertTrue(event.fields[11], "told again")
                    self.assertEqual(repeated_numbers(event.payload, 12), groups[1:-1])
                    self.assertEqual([subscriber.next().dst for _ in groups], groups)
                    self.assertEqual(subscribe(subscriber.client, "A/B")[3], groups[-1])

    def test_where_the_event_was_lost_with_the_connection(self):
        hub = Hub(self)
        provider = Provider(self, hub, STREAM_DELIVERY)
        subscriber = Subscriber(self, hub)
        first = provider.group
        # Told on the first connection and on the next two, which break before they are read.
        for _ in range(3):
            second = move(provider)
            subscriber.cut()
            subscriber.come_back()
        subscriber.cut()
        provider.publish()
        subscriber.come_back()
        event = subscriber.next()
        self.assertEqual((event.kind, event.fields[4], event.fields[5]), (NS, first, second))
        self.assertEqual(subscriber.next().dst, second)

    def test_what_was_read_is_not_told_again(self):
        hub = Hub(self)
        provider = Provider(self, hub, STREAM_DELIVERY)
        subscriber = Subscriber(self, hub)
        second = move(provider)
        self.assertEqual([subscriber.next().fields[5] for _ in range(2)], [0, second])

        def comes_back_to_no_event():
            # PINGs are answered while it waits for the answer, and that is not behind the last of them.
            subscriber.client.ask(NS, RESOLVE, text(3, "A"))
            subscriber.cut()
            provider.publish()
            subscriber.come_back()
            got = subscriber.next()
            if got.kind == NS:
                self.assertEqual((got.fields[5], subscriber.next().dst), (second, second))
            return got.kind == GROUP

        wait_until(comes_back_to_no_event, "the hub knows that the event was read")

    def test_a_service_that_is_gone(self):
        hub = Hub(self)
        provider = Provider(self, hub, STREAM_DELIVERY)
        subscriber = Subscriber(self, hub)
        subscriber.cut()
        provider.publish()
        self.assertEqual(provider.client.ask(NS, WITHDRAW, number(3, 4, provider.group))[1], 0)
        subscriber.come_back()
        self.assertEqual(subscriber.next().fields[5], 0)
        self.assertEqual(subscriber.next().dst, provider.group)


if __name__ == "__main__":
    unittest.main()
