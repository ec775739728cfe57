#!/usr/bin/env python3
"""The command lines in the documents that build something, as a newcomer types them.

A line is a paragraph, or a part of one, that is indented by four spaces and whose first word is a compiler, a build
tool or `./dev`; a `\\` at its end joins the next one. Compilers run in a folder outside of this tree. Of `./dev` only
the command is asked whether it is there, and of `./dev build` whether its targets are: that build made these tests."""

import collections
import json
import pathlib
import re
import shlex
import subprocess
import tempfile
import unittest

from support.documents import programs_of_the_readme
from support.processes import BIN, ROOT, TCPHUB, Hub, Process, run_gimnet, start_gimnet
from support.waiting import wait_until

BUILD = BIN.parent
EXAMPLES = ROOT / "examples"
COMPILERS = ("g++", "gcc")
BUILDERS = (*COMPILERS, "c++", "cc", "clang", "clang++", "cmake", "make", "ninja", "./dev")
PATIENCE_S = 300
# Of a page that says "mine.cpp": any program will do.
MINE = {"mine.cpp": EXAMPLES / "publisher.cpp", "mine.c": EXAMPLES / "hello.c"}

# Around the example of docs/nif.md.
C_PROGRAM = """#include <stdio.h>
#include "gimnet/nif.h"
int main(void) {{
  const nif_options options = {{.struct_size = sizeof options}};
  nif_node* node = NULL;
  uint32_t peer = 0;
  if (nif_connect(&options, &node) != NIF_OK) return 1;
  if (nif_resolve(node, "B", &peer, 5000) != NIF_OK) return 2;
{code}
  return nif_close(node) == NIF_OK ? 0 : 3;
}}
"""

Line = collections.namedtuple("Line", "page number text")


def pages():
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.md"),
             *(ROOT / "fuzz").glob("*.md")]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sorted(found)}


def lines_of(page, text):
    joined = re.sub(r"\\\n +", lambda cut: " " * len(cut[0]), text)
    found = []
    for match in re.finditer(r"^    (\S+)(.*)$", joined, re.M):
        if match[1] in BUILDERS:
            words = shlex.split(match[0], comments=True)
            found.append(Line(page, text.count("\n", 0, match.start()) + 1, " ".join(words)))
    return found


def all_lines():
    return [line for page, text in pages().items() for line in lines_of(page, text)]


def second_hub_of_the_readme():
    """The words of each line that links a second hub."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"^Link a second hub[^\n]*\n\n((?:    [^\n]*\n)+)", text, re.M)[1]
    return [shlex.split(line, comments=True) for line in block.splitlines()]


class Documented(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        # The folder of the documents, as seen from a build that need not be the one that they name.
        self.tree = self.folder / "gimnet"
        (self.tree / "build").mkdir(parents=True)
        (self.tree / "build" / "release").symlink_to(BUILD)
        (self.tree / "include").symlink_to(ROOT / "include")

    def shell(self, line, folder):
        ended = subprocess.run(["sh", "-c", line], cwd=folder, env={"PATH": "/usr/bin:/bin", "GIMNET": str(self.tree)},
                               capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        self.assertEqual(ended.returncode, 0, f"{line}\n{ended.stderr}")

    def compile(self, line):
        """Within the tree where the line has paths of it, else in a folder beside it. Returns the folder."""
        folder = self.folder / "elsewhere" if "$GIMNET" in line.text else self.tree
        folder.mkdir(exist_ok=True)
        for name, source in MINE.items():
            (folder / name).write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
        for name, text in programs_of_the_readme().items():
            (folder / name).write_text(text, encoding="utf-8")
        self.shell(line.text, folder)
        return folder

    def test_each_line_that_compiles_does(self):
        lines = [line for line in all_lines() if line.text.split()[0] in COMPILERS]
        self.assertGreaterEqual(len(lines), 3, "the documents were not understood")
        for line in lines:
            with self.subTest(page=line.page, line=line.number):
                self.compile(line)

    def test_each_command_of_dev_is_there(self):
        lines = [line for line in all_lines() if line.text.startswith("./dev ")]
        self.assertGreaterEqual(len(lines), 5, "the documents were not understood")
        for command in sorted({line.text.split()[1] for line in lines}):
            with self.subTest(command=command):
                asked = subprocess.run([ROOT / "dev", command, "--help"], capture_output=True, text=True,
                                       timeout=PATIENCE_S, check=False)
                self.assertEqual(asked.returncode, 0, asked.stderr)

    def test_each_target_of_a_build_is_there(self):
        named = [line for line in all_lines() if line.text.split()[:2] == ["./dev", "build"]]
        self.assertTrue(named, "the documents were not understood")
        for line in named:
            with self.subTest(page=line.page, line=line.number):
                targets = line.text.split()[2:] or ["product"]
                asked = subprocess.run(["ninja", "-n", "-C", BUILD, *targets], capture_output=True, text=True,
                                       timeout=PATIENCE_S, check=False)
                self.assertEqual(asked.returncode, 0, asked.stderr + asked.stdout)

    def test_each_preset_is_there(self):
        presets = {preset["name"] for preset in json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]}
        named = [name for line in all_lines() for name in re.findall(r" --preset (\S+)", line.text)]
        self.assertTrue(named, "the documents were not understood")
        self.assertLessEqual(set(named), presets)

    def test_no_other_line_builds(self):
        """A page that shows another way to build something needs a test of it here."""
        for line in all_lines():
            with self.subTest(page=line.page, line=line.number):
                installed = "$(pkg-config --cflags --libs" in line.text  # tests/install
                self.assertTrue(line.text.split()[0] in (*COMPILERS, "./dev") or " --preset " in line.text or installed, line.text)

    def test_the_programs_of_the_readme_are_short_and_run(self):
        programs = programs_of_the_readme()
        self.assertEqual(sorted(programs), ["publisher.cpp", "subscriber.cpp"])
        for name, text in programs.items():
            self.assertLessEqual(len(text.splitlines()), 10, name)
        line = next(line for line in all_lines() if line.page == "README.md" and line.text.startswith("g++ "))
        folder = self.compile(line)
        folder = self.compile(line._replace(text=line.text.replace("publisher", "subscriber")))
        for name in ("publisher", "subscriber"):
            alone = Process([folder / name], env={"GIMNET_HUB": "tcp://127.0.0.1:1"})
            self.addCleanup(alone.end)
            self.assertEqual(alone.wait(), 1, alone.err)
            self.assertIn("tcp://127.0.0.1:1", alone.err)
            self.assertNotIn("terminate called", alone.err)
        hub = Hub(self)
        subscriber = self.start(hub, folder / "subscriber")
        publisher = self.start(hub, folder / "publisher")
        wait_until(lambda: subscriber.out.count(b"\n") >= 3, f"three messages; it said: {subscriber.err}")
        self.assertEqual(set(subscriber.out.splitlines()), {b"x 1.0 y 2.0"})
        hub.process.signal(9)
        hub.process.wait()
        wait_until(lambda: "gimnet: robot: lost the connection to the hub" in publisher.err,
                   f"the reason; it said: {publisher.err}")
        before = subscriber.out.count(b"\n")
        hub = hub.again(self)
        wait_until(lambda: subscriber.out.count(b"\n") >= before + 3, "messages by the hub that was started anew")
        self.assertIsNone(publisher.popen.poll(), publisher.err)
        self.assertEqual(run_gimnet(f"unix:{hub.socket_path}", "ctl", "kick", "robot").code, 0)
        self.assertEqual(publisher.wait(), 0, publisher.err)

    def test_the_second_hub_of_the_readme_links_and_its_end_is_told(self):
        start, link, look = second_hub_of_the_readme()
        url = "tcp://127.0.0.1:7451"
        self.assertEqual((start[0], link[0], look), ("tcphub", "gimnet", ["gimnet", "watch"]))
        first = Hub(self, hub_id=None)
        words = [TCPHUB, *start[1:], "--state-dir", self.folder / "second"]
        second = Process(["tcp://127.0.0.1:0" if word == url else word for word in words])
        self.addCleanup(second.end)
        wait_until(lambda: second.out.endswith(b"\n"), f"the second hub is ready; it said: {second.err}")
        real = second.out.decode().split()[1]
        self.assertIn(url, link)
        watch = start_gimnet(self, first, *look[1:])
        wait_until(lambda: "nothing is there yet" in watch.err, "the watch has begun")
        linked = run_gimnet(f"unix:{first.socket_path}", *[real if word == url else word for word in link[1:]])
        self.assertEqual(linked.code, 0, linked.err)
        wait_until(lambda: b"  reachable    hub 2 hub-2\n" in watch.out, f"the hub that came; the watch said {watch.out}")
        second.signal(9)
        wait_until(lambda: b"  unreachable  hub 2 hub-2\n" in watch.out, f"the hub that went; the watch said {watch.out}")

    def test_gimi_takes_what_the_c_example_of_nif_sends(self):
        text = (ROOT / "docs" / "nif.md").read_text(encoding="utf-8")
        code = next(code for code in re.findall(r"\n\n((?:    .*\n)+)", text) if "nif_send(" in code)
        page = next(line for line in all_lines() if line.text.startswith("gcc "))
        self.compile(page)
        (self.tree / "mine.c").write_text(C_PROGRAM.format(code=code), encoding="utf-8")
        self.shell(page.text, self.tree)
        hub = Hub(self)
        receiver = start_gimnet(self, hub, "recv", "--name", "B", "--json", "-n", "1", "--type", "4",
                                "--instance", "1")
        hub.wait_for_node("B")
        mine = self.start(hub, self.tree / "mine")
        self.assertEqual(mine.wait(), 0, mine.err)
        self.assertEqual(receiver.wait(), 0, receiver.err)
        got = json.loads(receiver.out)
        self.assertEqual([got[key] for key in ("type", "instance", "sequence", "text")], [4, 1, 1, "v 0.5"])

    def start(self, hub, program):
        process = Process([program], env={"GIMNET_HUB": hub.url, "GIMNET_LOG": "info"})
        self.addCleanup(process.end)
        return process


if __name__ == "__main__":
    unittest.main()
