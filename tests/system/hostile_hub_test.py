#!/usr/bin/env python3
"""A hub that lies to its neighbour: others join as before, and commands end."""

import json
import threading
import time
import unittest

from support.liar import Liar
from support.processes import Hub, run_gimnet
from support.waiting import wait_until

INVENTED = 4_000
# Ten times what a join takes at most beside such a hub (docs/operations.md). `gimnet` gives up after as long.
JOIN_S = 5.0
# Of `status --all`, however many hubs are silent; twice that, since other tests run beside this one.
STATUS_S = 15.0


class HostileHub(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self, "--accept-links", hub_id=1)
        self.liar = Liar(self, self.hub)

    def reachable(self):
        hubs = json.loads(run_gimnet(self.hub, "hubs", "--json").out or "[]")
        return sum(hub["reachable"] for hub in hubs)

    def slowest_join(self, joins):
        slowest = 0
        for _ in range(joins):
            began = time.monotonic()
            joined = run_gimnet(self.hub, "ctl", "connections")
            self.assertEqual(joined.code, 0, joined.err)
            slowest = max(slowest, time.monotonic() - began)
        return slowest

    def test_nodes_join_beside_a_hub_that_invents_others(self):
        self.liar.invent(INVENTED)
        wait_until(lambda: self.reachable() > INVENTED, "the invented hubs")
        times = [self.slowest_join(4)]
        sent = []
        flood = threading.Thread(target=lambda: sent.append(self.liar.flood(4)))
        flood.start()
        while flood.is_alive():
            times.append(self.slowest_join(1))
        self.assertGreater(sent[0], 1_000)
        self.liar.end()
        times.append(self.slowest_join(4))
        print(f"slowest of {len(times)} joins: {max(times):.2f} s, beside {sent[0]} records", flush=True)
        self.assertLess(max(times), JOIN_S)

    def test_status_of_all_hubs_ends_however_many_are_silent(self):
        self.liar.invent(200)
        wait_until(lambda: self.reachable() > 200, "the invented hubs")
        began = time.monotonic()
        asked = run_gimnet(self.hub, "status", "--all", "--json")
        took = time.monotonic() - began
        self.assertEqual(asked.code, 0, asked.err)
        status = json.loads(asked.out)
        errors = {hub["id"]: hub.get("error") for hub in status["hubs"]}
        self.assertEqual((len(errors), status["exact"], errors[1]), (202, False, None))
        self.assertIn("not asked: too many are silent", errors.values())
        print(f"status --all took {took:.1f} s", flush=True)
        self.assertLess(took, 2 * STATUS_S)


if __name__ == "__main__":
    unittest.main()
