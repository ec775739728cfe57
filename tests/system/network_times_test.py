#!/usr/bin/env python3
"""Names in a network of hubs are known within the time that is stated: in the full size that time itself, else ten times
as much, since other programs run beside this one."""

import os
import statistics
import time
import unittest

from stranger_parts.bitestream import BOOL, every, fields, put
from stranger_parts.case import PATIENT, Case
from stranger_parts.client import NS, Denied
from support.processes import run_gimnet
from support.waiting import wait_until

FULL = os.environ.get("GIMNET_STRESS") == "full"
TIMES = 1 if FULL else 10
NAME_LOST = 36


class Names(Case):
    def chain(self, ids):
        """Hubs of which each dials the one before it."""
        hubs = []
        for number in ids:
            link = ("--link", hubs[-1].url) if hubs else ()
            hubs.append(self.hub("--accept-links", *link, *PATIENT, hub_id=number))
        return hubs

    @staticmethod
    def resolved(who, name):
        try:
            return who.resolve(name)
        except Denied:
            return None

    def test_a_name_at_one_end_of_a_chain_of_8_is_known_at_the_other(self):
        hubs = self.chain(range(1, 9))
        viewer, early = self.stranger(hubs[-1], "viewer"), self.stranger(hubs[0], "early")
        wait_until(lambda: self.resolved(viewer, "early") == early.id, "the chain")
        took_ms = []
        for number in range(5):
            robot = self.stranger(hubs[0], f"robot-{number}")
            began = time.monotonic()
            wait_until(lambda robot=robot, number=number: self.resolved(viewer, f"robot-{number}") == robot.id,
                       "the name at the other end", pause_s=0.001)
            took_ms.append((time.monotonic() - began) * 1000)
        self.assertLess(statistics.median(took_ms), 100 * TIMES, took_ms)

    def test_two_halves_that_gave_the_same_100_names_agree_on_one_owner_of_each(self):
        left, right = self.chain((1, 2)), self.chain((3, 4))
        names = [f"robot-{number}" for number in range(100)]
        there = {name: [self.stranger(hub, name) for hub in (left[0], right[0])] for name in names}
        askers = [self.stranger(hub) for hub in left + right]
        for asker in askers:
            wait_until(lambda asker=asker: all(self.resolved(asker, name) for name in names), "the names of a half")
        began = time.monotonic()
        joined = run_gimnet(f"unix:{right[1].socket_path}", "ctl", "link", "add", left[1].url)
        self.assertEqual(joined.code, 0, joined.err)

        def owners(asker):
            given = [fields(node) for node in every(asker.ask(NS, 5, put(6, BOOL, True)), 3)]
            return sorted((node[2], node[1]) for node in given if node.get(2))

        def agree():
            seen = [owners(asker) for asker in askers]
            # A name that was not given up yet stands there twice.
            one_each = [name for name, _ in seen[0]] == sorted(names)
            return one_each and all(each == seen[0] for each in seen) and dict(seen[0])
        owner = wait_until(agree, "one owner of each name")
        losers = [each for name in names for each in there[name] if each.id != owner[name]]
        self.assertEqual(len(losers), len(names), "of each name one of the two that had it")
        for loser in losers:
            loser.event(NAME_LOST)
        self.assertLess(time.monotonic() - began, 4 * TIMES)


if __name__ == "__main__":
    unittest.main()
