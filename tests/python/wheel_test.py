#!/usr/bin/env python3
"""The wheel installs into a virtual environment without a network, and runs on Ubuntu 22.04.

    wheel_test.py LIBRARY"""

import importlib.util
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import venv

ROOT = pathlib.Path(__file__).resolve().parents[2]
GLIBC_OF_UBUNTU_22_04 = (2, 35)
TIMEOUT_S = 120


class Wheel(unittest.TestCase):
    def run_command(self, *command):
        done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              timeout=TIMEOUT_S, env={"PATH": "/usr/bin:/bin"}, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout.strip()

    def test_installs_without_a_network_and_runs_on_ubuntu_22_04(self):
        with tempfile.TemporaryDirectory() as folder:
            wheel = self.run_command(sys.executable, ROOT / "python" / "make_wheel.py", LIBRARY, folder)
            glibc = re.search(r"-py3-none-manylinux_(\d+)_(\d+)_\w+\.whl$", wheel)
            self.assertLessEqual((int(glibc[1]), int(glibc[2])), GLIBC_OF_UBUNTU_22_04)
            environment = pathlib.Path(folder) / "environment"
            venv.create(environment, with_pip=False)
            python = environment / "bin" / "python"
            where = self.run_command(python, "-c", "import sysconfig; print(sysconfig.get_path('platlib'))")
            if importlib.util.find_spec("pip"):
                self.run_command(sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--target", where, wheel)
            else:  # a wheel without scripts is installed where it is unpacked
                self.run_command(sys.executable, "-m", "zipfile", "-e", wheel, where)
            self.assertIn("NoHub", self.run_command(python, "-c", """
import gimnet
try: gimnet.connect(hub="tcp://127.0.0.1:1")
except gimnet.NoHub as error: print(type(error))
"""))


if __name__ == "__main__":
    LIBRARY = sys.argv.pop()
    unittest.main()
