#!/usr/bin/env python3
"""Many hubs in one network: a chain as long as frames may go and one hub longer, a ring, a star, and a mesh."""

import json
import os
import random
import tempfile
import unittest

from support.logs import robot_logs
from support.processes import TCPHUB, Process, run_gimnet, start_gimnet
from support.waiting import wait_until


class Network(unittest.TestCase):
    def start(self, dials):
        """Starts the hubs 1 to N at once, each of which dials those that `dials` names, over Unix sockets. Gives their
        URLs by id. Costs are fixed: measured ones fall for a second, and a frame that meets a hub with other routes on
        its way is dropped."""
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        self.addCleanup(folder.cleanup)
        urls = {number: "unix:" + os.path.join(folder.name, f"{number}.sock") for number in dials}
        hubs = {}
        for number, others in dials.items():
            words = [TCPHUB, "--shards", "1", "--hub-id", str(number), "--listen", urls[number], "--accept-links",
                     "--state-dir", os.path.join(folder.name, str(number))]
            config = os.path.join(folder.name, f"{number}.toml")
            with open(config, "w", encoding="utf-8") as file:
                file.writelines(f'[[link]]\nurl = "{urls[other]}"\ncost = 10\n' for other in others)
            words += ["--config", config]
            hubs[number] = Process(words)
            self.addCleanup(hubs[number].end)
        for number, hub in hubs.items():
            wait_until(lambda hub=hub: hub.out.startswith(b"ready") or hub.popen.poll() is not None, f"hub {number}")
            self.assertIsNone(hub.popen.poll(), hub.err)
        self.hubs = hubs
        return urls

    def tearDown(self):
        self.assertEqual([hub.err for hub in self.hubs.values() if hub.popen.poll() is not None], [])

    def seen_from(self, url):
        return {hub["id"]: hub for hub in json.loads(run_gimnet(url, "hubs", "--json").out or "[]")}

    def until_reached(self, url, others):
        def all_there():
            seen = self.seen_from(url)
            return all(other in seen and seen[other]["reachable"] for other in others) and seen
        return wait_until(all_there, f"the hubs {sorted(others)} seen from {url}")

    def until_all_reach_all(self, urls):
        for number, url in urls.items():
            self.until_reached(url, urls)

    def carry(self, here, there):
        """A robot's log, from a node at one hub to one at another, byte for byte; found by its name."""
        log = robot_logs()[0]
        receiver = start_gimnet(self, there, "recv", "--name", "B", "--raw", "-n", str(log.count(b"\n")))
        wait_until(lambda: run_gimnet(here, "nodes", "B").code == 0, "the name B at the other end")
        sent = run_gimnet(here, "send", "B", data=log)
        self.assertEqual(sent.code, 0, sent.err)
        self.assertEqual((receiver.wait(), receiver.out == log), (0, True), receiver.err)


class Chain(Network):
    def test_32_hubs_reach_each_other_and_the_33rd_is_too_far(self):
        urls = self.start({number: [number - 1] if number > 1 else [] for number in range(1, 34)})
        seen = self.until_reached(urls[1], range(1, 33))
        self.assertEqual((seen[32]["distance"], seen[32]["too_far"]), (31, False))
        self.assertEqual(self.until_reached(urls[33], range(2, 34))[2]["distance"], 31)
        far = wait_until(lambda: self.seen_from(urls[1]).get(33), "the word of hub 33")
        self.assertTrue(far["too_far"])
        self.carry(urls[1], urls[32])
        for here, there in ((1, 33), (33, 1)):
            sent = run_gimnet(urls[here], "send", f"{there}.1", data=b"too far\n")
            self.assertNotEqual(sent.code, 0)
            self.assertIn("no_route", sent.err)
            routes = run_gimnet(urls[here], "routes", f"{there}.1")
            self.assertEqual(routes.code, 4)
            self.assertIn("it is too far", routes.err)


class Sixteen(Network):
    """16 hubs of which each reaches every other."""

    NUMBERS = range(1, 17)

    def test_a_ring(self):
        urls = self.start({number: [number % 16 + 1] for number in self.NUMBERS})
        self.until_all_reach_all(urls)
        self.carry(urls[1], urls[9])
        # Each half goes on over the other way round.
        self.hubs[5].popen.kill()
        self.hubs.pop(5).popen.wait()
        wait_until(lambda: self.seen_from(urls[1]).get(6, {}).get("via") == 16, "the way round hub 5")
        self.carry(urls[1], urls[6])

    def test_a_star(self):
        urls = self.start({number: [1] if number > 1 else [] for number in self.NUMBERS})
        self.until_all_reach_all(urls)
        self.carry(urls[2], urls[16])

    def test_a_mesh(self):
        choose = random.Random(1)
        urls = self.start({number: choose.sample(range(1, number), min(number - 1, 3)) for number in self.NUMBERS})
        self.until_all_reach_all(urls)
        self.carry(urls[16], urls[1])


if __name__ == "__main__":
    unittest.main()
