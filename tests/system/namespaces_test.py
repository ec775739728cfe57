#!/usr/bin/env python3
"""Two hubs on two machines with a router between them: network namespaces of this machine. One open TCP port is enough, and
a firewall that drops silently is noticed, reported, and recovered from. Needs root and the right to make namespaces."""

import json
import os
import shutil
import subprocess
import unittest

from support import skips
from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import wait_until

ROBOT, LAB = "10.98.1.1", "10.98.2.1"


def ip(*words):
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=False)


def why_not():
    """Why there can be no namespaces here, or None."""
    if os.geteuid() != 0 or not shutil.which("ip") or not shutil.which("ss"):
        return "network namespaces need root and the package iproute2"
    name = f"t{os.getpid()}"
    made = ip("netns", "add", name)
    ip("netns", "del", name)
    return None if made.returncode == 0 else f"network namespaces are not allowed here: {made.stderr.strip()}"


@unittest.skipIf(why_not(), why_not())
class TwoMachines(unittest.TestCase):
    def setUp(self):
        self.robot, self.router, self.lab = (f"t{os.getpid()}-{part}" for part in ("robot", "router", "lab"))
        for name in (self.robot, self.router, self.lab):
            self.addCleanup(ip, "netns", "del", name)
            self.do("netns", "add", name)
            self.do("-n", name, "link", "set", "lo", "up")
        for end, device, address in ((self.robot, "vn", ROBOT), (self.lab, "vh", LAB)):
            gate = address.rsplit(".", 1)[0] + ".254"
            self.do("link", "add", "name", device + "0", "netns", end, "type", "veth", "peer", "name", device + "1", "netns",
                    self.router)
            for name, which, own in ((end, "0", address), (self.router, "1", gate)):
                self.do("-n", name, "addr", "add", own + "/24", "dev", device + which)
                self.do("-n", name, "link", "set", device + which, "up")
            self.do("-n", end, "route", "add", "default", "via", gate)
        self.do("netns", "exec", self.router, "sysctl", "-qw", "net.ipv4.ip_forward=1")

    def do(self, *words):
        done = ip(*words)
        self.assertEqual(done.returncode, 0, f"ip {' '.join(words)}: {done.stderr}")

    def open_ports(self, name):
        shown = subprocess.run(["ip", "netns", "exec", name, "ss", "-Hltn"], capture_output=True, text=True, check=True)
        return shown.stdout.splitlines()

    def reaches(self, hub, other):
        hubs = json.loads(run_gimnet(hub, "hubs", "--json").out or "[]")
        return any(each["id"] == other and each["reachable"] for each in hubs)

    def test_one_port_is_enough_and_a_silent_firewall_is_recovered_from(self):
        lab = Hub(self, "--accept-links", "--insecure", hub_id=1, netns=self.lab,
                  listen=lambda socket: [f"tcp://{LAB}:0", socket])
        robot = Hub(self, "--link", lab.url, "--insecure", hub_id=2, netns=self.robot, listen=lambda socket: [socket])
        near, far = (f"unix:{hub.socket_path}" for hub in (lab, robot))  # a path leads there from every namespace
        wait_until(lambda: self.reaches(near, 2) and self.reaches(far, 1), "a link")
        self.assertEqual(self.open_ports(self.robot), [], "the robot opened a port")
        self.assertEqual(len(self.open_ports(self.lab)), 1)
        receivers = {}
        for name, here, there in (("operator", near, far), ("wheels", far, near)):
            receivers[name] = start_gimnet(self, here, "recv", "--name", name, "--raw")
            wait_until(lambda there=there, name=name: run_gimnet(there, "nodes", name).code == 0, f"{name} at the other hub")
            self.assertEqual(run_gimnet(there, "send", name, data=b"before\n").code, 0)

        for address in (ROBOT, LAB):  # neither way, and nobody is told
            self.do("-n", self.router, "route", "add", "blackhole", address + "/32")
        wait_until(lambda: not self.reaches(near, 2) and not self.reaches(far, 1), "silence noticed at both ends")
        lost = run_gimnet(near, "send", "2.1", data=b"lost\n")
        self.assertNotEqual(lost.code, 0)
        self.assertIn("no_route", lost.err)
        self.assertEqual(run_gimnet(far, "send", "wheels", data=b"alone\n").code, 0, "a hub that is cut off serves its own")
        for address in (ROBOT, LAB):
            self.do("-n", self.router, "route", "del", "blackhole", address + "/32")
        wait_until(lambda: self.reaches(near, 2) and self.reaches(far, 1), "the link again")
        for name, there in (("operator", far), ("wheels", near)):
            wait_until(lambda there=there, name=name: run_gimnet(there, "send", name, data=b"after\n").code == 0, f"{name} again")
        for name, lines in (("operator", b"before\nafter\n"), ("wheels", b"before\nalone\nafter\n")):
            wait_until(lambda name=name, lines=lines: receivers[name].out == lines, f"what {name} got")


if __name__ == "__main__":
    skips.main()
