#!/usr/bin/env python3
"""The files that hubs and programs leave on a machine are those of docs/operations.md, "What stays on a machine", and its lines
remove them."""

import os
import pathlib
import re
import signal
import subprocess
import tempfile
import unittest

from support.processes import GIMNET, ROOT, TCPHUB, Process
from support.waiting import wait_until


def lines_that_remove():
    page = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
    section = page[page.index("### What stays on a machine"):]
    return re.findall(r"^    (rm .*)$", section[:section.index("\n## ")], re.M)


class Leftovers(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        self.addCleanup(folder.cleanup)
        self.home = pathlib.Path(folder.name)
        for name in ("home", "run", "tmp"):
            (self.home / name).mkdir(mode=0o700)

    def leave_files(self, environment):
        """A hub and a node that are killed."""
        hub = self.start([TCPHUB, "--listen", f"unix:{self.home}/hub.sock", "--hub-name", "h"], environment)
        wait_until(lambda: hub.out.startswith(b"ready "), f"the hub is ready; it said: {hub.err}")
        node = self.start([GIMNET, "--hub", f"unix:{self.home}/hub.sock", "recv", "--name", "B"], environment)
        wait_until(lambda: self.files("tokens/B."), f"the token of B; it said: {node.err}")
        for process in (node, hub):
            process.signal(signal.SIGKILL)
            process.wait()
        (self.home / "hub.sock").unlink()

    def start(self, words, environment):
        process = Process(words, env=environment)
        self.addCleanup(process.end)
        return process

    def files(self, part=""):
        found = [str(path.relative_to(self.home)) for path in self.home.rglob("*") if path.is_file()]
        return sorted(path for path in found if part in path)

    def test_the_lines_of_the_page_remove_what_stays(self):
        lines = lines_that_remove()
        self.assertEqual(len(lines), 3, "the page was not understood")
        variables = {"HOME": f"{self.home}/home", "TMPDIR": f"{self.home}/tmp"}
        of_a_session = {"XDG_RUNTIME_DIR": f"{self.home}/run", "XDG_STATE_HOME": str(self.home / "home" / "state")}
        neither = {"XDG_RUNTIME_DIR": "", "XDG_STATE_HOME": ""}
        for name, others in (("of a session", of_a_session), ("neither", neither)):
            with self.subTest(name):
                environment = {**variables, **others}
                self.leave_files(environment)
                left = self.files()
                self.assertTrue(any("/gimnet/hub-" in path and path.endswith("/state") for path in left), left)
                self.assertTrue(all("/gimnet/" in path or f"/gimnet-{os.getuid()}/" in path for path in left), left)
                for line in lines:
                    subprocess.run(["sh", "-c", line], cwd=self.home / "home", check=True,
                                   env={"PATH": "/usr/bin:/bin", **environment})
                self.assertEqual(self.files(), [])


if __name__ == "__main__":
    unittest.main()
