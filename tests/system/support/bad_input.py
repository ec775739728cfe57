"""What tests of bad input have in common: after each of them the hub has counted exactly what came, keeps nothing of it,
and serves others as if nothing had happened."""

import collections
import re
import unittest

from support.processes import Hub
from support.waiting import wait_until
from support.wire import GOODBYE, LINK, NS, Client, control, frame, number

STATUSES = "done not_supported bad_request not_found taken denied limit rate".split()
# What a hub counts of input that is of no use. Drops are compared where a test says what is to be dropped.
BAD_INPUT = re.compile(r"refused\..*|(names|ctrl)\.(unknown|refused\..*)|malformed|wrong_source|stalled_frames|bad_credits"
                       r"|unfinished_frames|too_many_requests|oddities|no_memory")


class HostileInput(unittest.TestCase):
    HANDSHAKE_MS = 600_000

    def setUp(self):
        # Nobody is too slow here but who is meant to be.
        self.hub = Hub(self, "--limit", f"handshake_ms={self.HANDSHAKE_MS}", "--limit", "silent_ms=600000")
        self.expected = collections.Counter()

    def expect(self, *names, times=1):
        """These counters will be higher by so much."""
        for name in names:
            self.expected[name] += times

    def bad_input(self):
        counters = self.hub.status()["counters"]
        return {name: value for name, value in counters.items()
                if value != 0 and (BAD_INPUT.fullmatch(name) or name in self.expected)}

    def tearDown(self):
        for client in getattr(self, "clients", ()):
            client.socket.close()
        counted = {}

        def as_expected():
            counted.update(now=self.bad_input())
            return counted["now"] == dict(self.expected)
        try:
            wait_until(as_expected, "the counters of bad input")
        except AssertionError:
            self.assertEqual(counted["now"], dict(self.expected))
        first, second = Client(self, self.hub).join(), Client(self, self.hub).join()
        first.send(first.frame(second.id, b"still here"))
        self.assertEqual(second.next_data().payload, b"still here")
        for client in (first, second):
            client.send(client.frame(0, control(GOODBYE, number(1, 3, 0)), kind=LINK))
            client.until_closed()
        wait_until(lambda: self.hub.counter("connections") == 1, "nothing that stays but the asking tool")
        self.hub.quiet_status(self)
        self.assertEqual(self.bad_input(), dict(self.expected))

    def closed_as(self, code, data):
        """What the hub answers a node that sends `data`."""
        client = Client(self, self.hub).join()
        client.send(data(client) if callable(data) else data)
        self.assertEqual(client.goodbye(), code)
        self.expect(code, f"dropped.{code}")

    def malformed(self, **how):
        how.setdefault("payload", b"x")
        with self.subTest(**how):
            self.closed_as("malformed", lambda client: frame(how.pop("dst", client.id), client.id, **how))

    def refused_as(self, codes, data):
        """What the hub answers a stranger that sends `data`. Returns the GOODBYE."""
        answer = Client(self, self.hub).send(data).first_answer()
        self.assertIn(answer.goodbye, codes)
        self.expect(f"refused.{answer.goodbye}")
        return answer

    def asked(self, client, kind, operation, body, statuses):
        """Which of these statuses a request is answered with."""
        status = STATUSES[client.ask(kind, operation, body)[1]]
        self.assertIn(status, statuses)
        if status != "done":
            self.expect(f"{'names' if kind == NS else 'ctrl'}.refused.{status}")
        return status
