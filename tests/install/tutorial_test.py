#!/usr/bin/env python3
"""docs/tutorial, as a newcomer follows it: installed into a folder of the own home, with the `export` lines of its first page,
each program built by the line of its page. The programs of one language have partners in another.

    tutorial_test.py CMAKE BUILD_FOLDER"""

import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "system"))

from support.documents import ENDINGS, TUTORIAL, Page  # noqa: E402
from support.processes import Hub, Process, run_gimnet  # noqa: E402
from support.waiting import wait_until  # noqa: E402

PROGRAMS = ["publish", "newest", "answer", "ask", "robot", "drive", "camera", "view"]
NEXT = {"cpp": "python", "c": "cpp", "python": "c"}
TIMEOUT_S = 300
LINES_MAX = 18
PYTHON = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)
NUMBER = re.compile(r"\d+(\.\d+)?")


def shape(text):
    return NUMBER.sub("N", text)


class Tutorial(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        cls.addClassCleanup(folder.cleanup)
        cls.home = pathlib.Path(folder.name)
        for component in ("runtime", "development", "tools", "hub", "python"):
            subprocess.run([CMAKE, "--install", BUILD, "--prefix", cls.home / "gimnet", "--component", component], check=True,
                           stdout=subprocess.DEVNULL, timeout=TIMEOUT_S)
        index = (TUTORIAL / "README.md").read_text(encoding="utf-8")
        exports = "\n".join(re.findall(r"^    (export .*)$", index, re.M))
        said = subprocess.run(["sh", "-c", f"{exports}\nenv -0"], env={"HOME": str(cls.home), "PATH": os.environ["PATH"]}, check=True,
                              capture_output=True, text=True, timeout=TIMEOUT_S)
        cls.environment = dict(pair.split("=", 1) for pair in said.stdout.split("\0") if pair)
        cls.environment.update({"PYTHONDONTWRITEBYTECODE": "1", "GIMNET_LIBRARY": ""})
        cls.pages = {language: Page(language) for language in ENDINGS}
        for language, page in cls.pages.items():
            cls.build(language, page)

    @classmethod
    def build(cls, language, page):
        folder = cls.home / language
        folder.mkdir()
        for name, text in page.programs.items():
            (folder / f"{name}{ENDINGS[language]}").write_text(text, encoding="utf-8")
            if page.build_line:
                line = page.build_line.replace("publish", name) + " -Wall -Wextra -Werror"
                built = subprocess.run(["sh", "-c", line], cwd=folder, env=cls.environment, capture_output=True, text=True,
                                       timeout=TIMEOUT_S, check=False)
                if built.returncode:
                    raise AssertionError(f"{line}\n{built.stderr}")

    def start(self, hub, language, name):
        file = self.home / language / name
        command = [sys.executable, f"{file}.py"] if language == "python" else [str(file)]
        process = Process(command, env={**self.environment, "GIMNET_HUB": hub.url})
        self.addCleanup(process.end)
        return process

    def pair(self, hub, language, giver, taker, at_taker=True):
        """Runs a program of this language and its partner of another one. What the page shows comes: of the taker, or the giver."""
        given, taken = self.start(hub, language, giver), None
        if giver in ("answer", "robot"):
            service = "calc/add" if giver == "answer" else "robot/drive"
            wait_until(lambda: service in run_gimnet(hub.url, "services").out.decode(), f"{service}; {given.err}")
        taken = self.start(hub, NEXT[language], taker)
        looked_at = taken if at_taker else given
        shown = self.pages[NEXT[language] if at_taker else language].shown[taker]
        wait_until(lambda: looked_at.out.count(b"\n") >= shown.count("\n"),
                   f"what {taker} in {NEXT[language]} makes of {giver} in {language}; they said: {given.err}{taken.err}")
        lines = looked_at.out.decode().splitlines(keepends=True)[:shown.count("\n")]
        self.assertEqual(shape("".join(lines)), shape(shown))
        for process in (given, taken):
            process.end()
        return [float(NUMBER.search(line)[0]) for line in lines]

    def test_each_page_has_all_programs_and_they_are_short(self):
        for language, page in self.pages.items():
            self.assertEqual(list(page.programs), PROGRAMS, language)
            self.assertEqual(sorted(page.shown), ["ask", "drive", "newest", "view"], language)
            for name, text in page.programs.items():
                self.assertLessEqual(len(text.splitlines()), LINES_MAX, f"{language}: {name}")

    def test_without_a_hub_each_says_so(self):
        hub = Hub(self)
        hub.process.end()
        for language in ENDINGS:
            for name in PROGRAMS:
                with self.subTest(language, program=name):
                    program = self.start(hub, language, name)
                    self.assertEqual(program.wait(), 1)
                    said = program.out.decode() + program.err
                    self.assertIn(f"cannot connect to {hub.url}", said)
                    self.assertNotIn("terminate called", said)

    def test_ctrl_c_ends_those_in_python_without_a_word(self):
        hub = Hub(self)
        goes_on = [name for name in PROGRAMS if name not in ("ask", "drive")]
        for name in goes_on:
            with self.subTest(name):
                program = self.start(hub, "python", name)
                wait_until(lambda: len(hub.nodes()) == 1, f"it is there; {program.err}")
                program.signal(signal.SIGINT)
                self.assertEqual((program.wait(), program.err), (0, ""))
                wait_until(lambda: not hub.nodes(), "it is gone")

    def test_what_shows_python_is_python(self):
        pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
        blocks = [(page, block) for page in pages for block in PYTHON.findall(page.read_text(encoding="utf-8"))]
        self.assertGreaterEqual(len(blocks), 15, "the pages were not understood")
        for page, block in blocks:
            compile(block, page.name, "exec")

    def test_the_pair_for_users_of_other_systems_runs(self):
        programs = PYTHON.findall((ROOT / "docs" / "coming-from.md").read_text(encoding="utf-8"))[:2]
        hub = Hub(self)
        robot, viewer = [Process([sys.executable, "-uc", text], env={**self.environment, "GIMNET_HUB": hub.url}) for text in programs]
        self.addCleanup(robot.end)
        self.addCleanup(viewer.end)
        wait_until(lambda: viewer.out.startswith(b"1.5\n1.5\n"), f"two poses; they said: {robot.err}{viewer.err}")

    def test_they_do_what_the_pages_show(self):
        for language in ENDINGS:
            with self.subTest(language):
                hub = Hub(self)  # of the former one it would wait for the nodes that were killed
                places = self.pair(hub, language, "publish", "newest")
                self.assertGreater(places[-1] - places[0], 0.2, "of a hundred a second it shows five")
                self.pair(hub, language, "answer", "ask")
                self.pair(hub, language, "robot", "drive", at_taker=False)
                pictures = self.pair(hub, language, "camera", "view")
                self.assertGreater(pictures[-1] - pictures[1], 3, "it skips the pictures that came meanwhile")


if __name__ == "__main__":
    BUILD = pathlib.Path(sys.argv.pop()).resolve()
    CMAKE = sys.argv.pop()
    os.environ.setdefault("GIMNET_BIN", str(BUILD / "bin"))
    unittest.main()
