"""A hub with two nodes in this process, and programs in Python beside them."""

import subprocess
import sys
import unittest

import gimnet
from support.processes import Hub
from support.waiting import PATIENCE_S


def program(lines, hub, *arguments):
    """A Python program with a node `node` named `name`."""
    text = (f"import gimnet, os, sys, threading\nhub = {hub.url!r}\n"
            f"node = gimnet.connect({arguments[0]!r}, hub=hub)\n{lines}")
    return subprocess.Popen([sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True)


class OneHub(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)

    def ends(self, process, code, noise="", patience=PATIENCE_S):
        out, err = process.communicate(timeout=patience)
        self.assertEqual((process.returncode, err), (code, noise), out)
        return out


class TwoNodes(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)
        self.robot = self.node("robot")
        self.viewer = self.node("viewer")

    def node(self, name):
        node = gimnet.connect(name, hub=self.hub.url)
        self.addCleanup(node.close)
        return node

    def pair(self, name, **how):
        publisher = self.robot.advertise(name, **how)
        subscription = self.viewer.subscribe(f"robot/{name}")
        publisher.wait_for_subscribers(1, PATIENCE_S)
        return publisher, subscription
