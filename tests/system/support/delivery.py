"""Services of every delivery, and a provider that publishes numbered messages of one."""

import struct

from support.wire import FLAG_KEYED, GROUP, LATEST, NS, Client, number, text, value

STREAM_DELIVERY, LATEST_DELIVERY, SYNC_DELIVERY = range(3)
SIZE = 1000


def advertise(client, name, delivery, window=None, retain=False):
    body = text(3, name) + number(7, 2, delivery)
    if window is not None:
        body += number(10, 4, window)
    if retain:
        body += value(11, 1, b"\1")
    return client.ask(NS, 7, body)


def subscription(name, **pace):
    body = text(3, name)
    if "window" in pace:
        body += number(4, 4, pace["window"])
    if "depth" in pace:
        body += number(5, 4, pace["depth"])
    if "rate_hz" in pace:
        body += value(6, 11, struct.pack("<d", pace["rate_hz"]))
    return body


def subscribe(client, name, **pace):
    return client.ask(NS, 10, subscription(name, **pace))


def message(sequence, content=b""):
    """A DATA message of GIMI with key 0."""
    return bytes(8) + struct.pack("<IIBBH", 1, sequence, 0, 0, 0) + content


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
