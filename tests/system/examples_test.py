#!/usr/bin/env python3
"""The programs of examples/, as a newcomer starts them, with a real hub: those in C and C++, and those in Python, which understand
each other. GIMNET_EXAMPLES names another folder with the compiled ones (tests/install)."""

import os
import pathlib
import re
import signal
import subprocess
import sys
import unittest

from support.processes import GIMNET, ROOT, Hub, Process, run_gimnet
from support.waiting import wait_until

EXAMPLES = os.environ.get("GIMNET_EXAMPLES") or os.path.join(os.path.dirname(GIMNET), "examples")
SCRIPTS = ROOT / "examples" / "python"
# Their packages and library, unless the environment names others.
PYTHON = {"PYTHONPATH": os.environ.get("PYTHONPATH") or str(ROOT / "python"), "PYTHONDONTWRITEBYTECODE": "1",
          "GIMNET_LIBRARY": os.environ.get("GIMNET_LIBRARY", "")}
LINES_MAX = 80
# All but SIGKILL and SIGSTOP, which nobody can block, and the two that belong to the C library.
ALL_SIGNALS = (1 << 64) - 1 & ~(1 << signal.SIGKILL - 1 | 1 << signal.SIGSTOP - 1 | 3 << 31)


def blocked_signals(process):
    """What the threads of a program block, without the first one, which is the program's own."""
    blocked = {}
    for task in pathlib.Path(f"/proc/{process.popen.pid}/task").iterdir():
        if task.name != str(process.popen.pid):
            line = next(line for line in (task / "status").read_text().splitlines() if line.startswith("SigBlk:"))
            blocked[task.name] = int(line.split()[1], 16)
    return blocked


def start(test, hub, name, *arguments, **pipes):
    """NAME is a compiled program, NAME.py one in Python."""
    command = [sys.executable, str(SCRIPTS / name)] if name.endswith(".py") else [os.path.join(EXAMPLES, name)]
    process = Process([*command, *arguments], env={"GIMNET_HUB": hub.url, **PYTHON}, **pipes)
    test.addCleanup(process.end)
    return process


def shown(process, pattern):
    """The groups of each line that matches."""
    return re.findall(rf"^{pattern}$", process.out.decode(), re.M)


class Examples(unittest.TestCase):
    def restart(self, hub):
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        return hub.again(self)

    def test_a_subscriber_prints_what_the_publisher_says(self):
        for which, other in (("publisher", "subscriber.py"), ("publisher.py", "subscriber")):
            with self.subTest(which):
                self.publish_over_a_restart(which, other)

    def publish_over_a_restart(self, which, other):
        hub = Hub(self)
        subscriber = start(self, hub, other)
        publisher = start(self, hub, which)
        wait_until(lambda: subscriber.out.count(b"\n") >= 3, f"three messages; it said: {subscriber.err}")
        self.assertRegex(subscriber.out.splitlines()[0].decode(), r"^7\.\d+ #\d+: x \d\.\d{6} y 0$")
        # Both go on when the hub is back, and the publisher says meanwhile that nothing arrives.
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        wait_until(lambda: re.search("publisher: (cannot publish robot/odom: the hub has been away for|not sent: .)", publisher.err),
                   f"the reason; it said: {publisher.err}")
        before = subscriber.out.count(b"\n")
        hub.again(self)
        wait_until(lambda: subscriber.out.count(b"\n") >= before + 3, "messages by the hub that was started anew")
        self.assertIsNone(publisher.popen.poll(), publisher.err)
        # The hub is looked at when it is quiet.
        publisher.signal(signal.SIGKILL)
        publisher.wait()

    def test_programs_of_one_thread_talk(self):
        for which, other in (("executor", "poll_loop.py"), ("wait_set.py", "poll_loop")):
            with self.subTest(which):
                hub = Hub(self)
                start(self, hub, which)
                hub.wait_for_node("robot")
                loop = start(self, hub, other, stdin=subprocess.PIPE)
                wait_until(lambda: b"x 0.000000" in loop.out, f"a pose; it said: {loop.err}")
                for line, answer in ((b"fast\n", b"'fast' is no speed\n"), (b"2\n", b"speed 2.000000\n"), (b"", b"x 1.")):
                    loop.popen.stdin.write(line)
                    loop.popen.stdin.flush()
                    wait_until(lambda: answer in loop.out, f"{answer}; it said: {loop.out} {loop.err}")
                loop.popen.stdin.close()
                self.assertEqual(loop.wait(), 0, loop.err)

    def test_a_kicked_publisher_ends(self):
        hub = Hub(self)
        for name in ("publisher", "publisher.py"):
            publisher = start(self, hub, name)
            hub.wait_for_node("robot")
            kicked = run_gimnet(f"unix:{hub.socket_path}", "ctl", "kick", "robot")
            self.assertEqual((kicked.code, publisher.wait()), (0, 1), kicked.err)

    def test_each_question_has_its_answer_also_when_the_hub_was_away(self):
        for which, other in (("adder", "ask.py"), ("adder.py", "ask")):
            with self.subTest(which):
                hub = Hub(self)
                adder = start(self, hub, which)
                hub.wait_for_node("calc")
                ask = start(self, hub, other, stdin=subprocess.PIPE)
                ask.popen.stdin.write(b"1.5 2\n")
                ask.popen.stdin.flush()
                wait_until(lambda: ask.out == b"1.5 2: 3.500000\n", f"the first answer; it said: {ask.err}")
                hub = self.restart(hub)
                hub.wait_for_node("calc")
                wait_until(lambda: len(hub.nodes()) == 2, "both are back")
                ask.feed(b"3\n1 apple\n4 5\n")
                self.assertEqual((ask.wait(), ask.out), (1, b"1.5 2: 3.500000\n3: 3.000000\n4 5: 9.000000\n"), ask.err)
                self.assertIn("these are not only numbers", ask.err)
                self.assertEqual(adder.err, "")

    def test_nobody_to_ask_is_said(self):
        for name in ("ask", "ask.py"):
            ask = start(self, Hub(self), name, stdin=subprocess.PIPE).feed(b"1\n")
            self.assertEqual(ask.wait(), 1)
            self.assertIn("calc/add", ask.err)
            self.assertNotIn("may have", ask.err)

    def test_a_pilot_drives_the_robot_and_sees(self):
        for which, other in (("robot", "pilot.py"), ("robot.py", "pilot")):
            with self.subTest(which):
                hub = Hub(self)
                robot = start(self, hub, which)
                hub.wait_for_node("robot")
                pilot = start(self, hub, other, "2", "0", "1")
                self.assertEqual(pilot.wait(), 0, pilot.err)
                way = [float(x) for x in shown(pilot, r"x (\S+) y 0\.0+ heading 0\.0+")]
                self.assertGreater(way[-1], 0.5, pilot.out)
                self.assertEqual(set(shown(pilot, r"picture \d+, (\d+) bytes")), {"76800"})
                # Nobody steers any more, so it stands still.
                watch = start(self, hub, "pilot", "0", "0", "1")
                self.assertEqual(watch.wait(), 0, watch.err)
                self.assertEqual(len(set(shown(watch, r"x (\S+) y .*")[2:])), 1, watch.out)
                self.assertEqual(robot.err, "")

    def test_a_camera_rests_while_nobody_watches(self):
        for which, other in (("camera", "viewer.py"), ("camera.py", "viewer")):
            with self.subTest(which):
                hub = Hub(self)
                camera = start(self, hub, which)
                wait_until(lambda: camera.out == b"camera: nobody watches\n", f"it rests; it said: {camera.err}")
                viewer = start(self, hub, other, "100")
                wait_until(lambda: len(shown(viewer, r"picture (\d+), 307200 bytes, \d+ skipped")) >= 4, f"pictures; {viewer.err}")
                numbers = [int(number) for number in shown(viewer, r"picture (\d+), .*")]
                self.assertGreater(numbers[3] - numbers[1], 2, "a slow viewer skips pictures")
                viewer.signal(signal.SIGKILL)
                viewer.wait()
                wait_until(lambda: camera.out.count(b"nobody watches") == 2, "it rests again")

    def test_they_are_short(self):
        sources = [path for path in SCRIPTS.parent.rglob("*") if path.suffix in (".c", ".cpp", ".py")]
        self.assertGreaterEqual(len(sources), 16, "the folder was not understood")
        for path in sources:
            self.assertLess(len(path.read_text().splitlines()), LINES_MAX, path)

    def test_control_c_ends_a_program_in_python_without_a_word(self):
        hub = Hub(self)
        subscriber = start(self, hub, "subscriber.py")
        wait_until(lambda: len(hub.nodes()) == 1, f"it is there; {subscriber.err}")
        subscriber.signal(signal.SIGINT)
        self.assertEqual((subscriber.wait(), subscriber.err), (0, ""))

    def test_the_mirror_sends_back_what_hello_says(self):
        hub = Hub(self)
        hello = start(self, hub, "hello")
        self.assertEqual(hello.wait(), 1)
        self.assertIn("cannot find the node mirror", hello.err)
        mirror = start(self, hub, "mirror")
        hub.wait_for_node("mirror")
        hello = start(self, hub, "hello", "hallo")
        self.assertEqual((hello.wait(), hello.out, hello.err), (0, b"hallo\n", ""))
        hub = self.restart(hub)
        hub.wait_for_node("mirror")
        hello = start(self, hub, "hello", "again")
        self.assertEqual((hello.wait(), hello.out, hello.err), (0, b"again\n", ""))
        self.assertEqual(mirror.err, "")

    def test_the_threads_of_the_libraries_take_no_signals(self):
        hub = Hub(self)
        for name, node in (("mirror", "mirror"), ("adder", "calc")):  # of NIF; of GIMI, which has no other one
            with self.subTest(name=name):
                program = start(self, hub, name)
                hub.wait_for_node(node)
                [blocked] = wait_until(lambda: blocked_signals(program), "its threads").values()
                self.assertEqual(blocked & ALL_SIGNALS, ALL_SIGNALS)

    def test_values_go_into_a_message_and_out_again(self):
        pose = start(self, Hub(self), "pose")
        self.assertEqual((pose.wait(), pose.out, pose.err),
                         (0, b"robot is at x 0.5\nrange 1\nrange 0.5\nrange 0.25\n", ""))

    def test_without_a_hub_they_say_so(self):
        hub = Hub(self)
        hub.process.end()
        for name in ("publisher", "subscriber", "adder", "ask", "robot", "pilot", "camera", "viewer", "executor", "poll_loop", "mirror", "hello",
                     *(path.name for path in SCRIPTS.glob("*.py"))):
            with self.subTest(name=name):
                process = start(self, hub, name)
                self.assertEqual(process.wait(), 1)
                self.assertIn(hub.url, process.err)


if __name__ == "__main__":
    unittest.main()
