"""A hub of the test's own, and strangers that join it."""

import unittest

from stranger.client import Stranger
from support.processes import Hub


class Case(unittest.TestCase):
    def hub(self, *arguments, **how):
        return Hub(self, *arguments, **how)

    def stranger(self, hub, name="", **how):
        made = Stranger(hub.url)
        self.addCleanup(made.close)
        return made.join(name, **how)
