"""A hub of the test's own, and strangers that join it."""

import unittest

from stranger_parts.bitestream import BOOL, TEXT, fields, put
from stranger_parts.client import NS, Refused, Stranger
from support.processes import Hub
from support.waiting import wait_until

# Nobody is silent too long: who does not read here does not answer PING either.
PATIENT = ("--limit", "silent_ms=3000000", "--limit", "keep_alive_ms=600000")


class Case(unittest.TestCase):
    def hub(self, *arguments, **how):
        return Hub(self, *arguments, **how)

    def connected(self, hub, local=False):
        made = Stranger(f"unix:{hub.socket_path}" if local else hub.url)
        self.addCleanup(made.close)
        return made

    def stranger(self, hub, name="", **how):
        return self.connected(hub).join(name, **how)

    def administrator(self, hub):
        return self.connected(hub, local=True).join(role=2)

    def until_away(self, who, name):
        """Returns when the hub has seen that the node's connection is gone."""
        connected = put(3, TEXT, name) + put(6, BOOL, True)
        wait_until(lambda: 3 not in fields(who.ask(NS, 5, connected)), f"{name} is away")

    def goodbye(self, who):
        """The code with which the hub closes."""
        with self.assertRaises(Refused) as refused:
            who.wait(lambda got: False)
        return refused.exception.args[0]
