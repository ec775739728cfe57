#!/usr/bin/env python3
"""The first day of a newcomer: the programs of README, tutorial and examples as they stand there, in bursts, with parts that are
killed, stopped and started again in any order. Each message arrived, or somebody was told. In the full size hubs stand still for 20 s."""

import itertools
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from support.documents import Page
from support.everyday import PROGRAMS, Everyday
from support.processes import BIN, ROOT, Hub, Process, run_gimnet, start_gimnet, start_recv
from support.proxy import Proxy
from support.waiting import wait_until

FULL = os.environ.get("GIMNET_STRESS") == "full"
STOP_S = 20.0 if FULL else 1.0
MORE_EVENTS = 60 if FULL else 0
MIB = 1 << 20
PROMPT_S = 2.0  # ten times the limit, which system.stopping holds in ./dev stress: a hang shows


def has_a_connection(process):
    descriptors = pathlib.Path(f"/proc/{process.popen.pid}/fd")
    return any(os.readlink(each).startswith("socket:") for each in descriptors.iterdir())


class FirstDay(unittest.TestCase):
    def start(self, hub, program, **pipes):
        """`program`: readme/NAME, cpp/NAME, c/NAME, python/NAME, examples/NAME."""
        page, name = program.split("/")
        if page == "python":
            command = [sys.executable, "-uc", Page("python").programs[name]]
        else:
            command = [BIN / page / name] if page == "examples" else [BIN / "documented" / page / name]
        process = Process(command, env={"GIMNET_HUB": hub.url, "PYTHONPATH": str(ROOT / "python"), "PYTHONDONTWRITEBYTECODE": "1"}, **pipes)
        self.addCleanup(process.end)
        return process

    def run_to_its_end(self, hub, program):
        process = self.start(hub, program)
        process.wait()
        return process

    def wait_for_service(self, hub, name):
        wait_until(lambda: re.search(rf"^{name} .* connected ", run_gimnet(hub, "services").out.decode(), re.M), f"the service {name}")

    def publish(self, hub, messages):
        """By `gimnet pub`, to one subscriber."""
        pub = run_gimnet(hub, "pub", "robot/odom", "--wait", "1", data=b"".join(messages))
        self.assertEqual(pub.code, 0, pub.err)
        return pub

    def until_accounted_for(self, subscriber, count):
        """Each of so many messages was printed, in order, or is among those that README's subscriber says it missed. Returns both."""
        def both():
            numbers = [int(line.split(maxsplit=1)[0]) for line in subscriber.out.splitlines()]
            missed = max((int(number) for number in re.findall(r"^(\d+) missed$", subscriber.err, re.M)), default=0)
            return (numbers, missed) if len(numbers) + missed >= count else None
        numbers, missed = wait_until(both, f"{count} messages; it said: {subscriber.err[-200:]}")
        self.assertEqual((len(numbers) + missed, numbers), (count, sorted(set(numbers))))
        return numbers, missed

    # ---- bursts and large messages

    def test_a_burst_arrives(self):
        hub = Hub(self)
        subscriber = self.start(hub, "readme/subscriber")
        pub = self.publish(hub, [b"%d\n" % number for number in range(20_000)])
        self.assertEqual((self.until_accounted_for(subscriber, 20_000)[1], pub.err.count("missed")), (0, 0), pub.err)
        receiver = start_recv(self, hub, "B", "-n", "20000")
        lines = b"".join(b"%d\n" % number for number in range(20_000))
        sent = run_gimnet(hub, "send", "B", data=lines)
        self.assertEqual((sent.code, receiver.wait(), receiver.out == lines), (0, 0, True), sent.err)

    def test_a_burst_that_a_program_does_not_take_is_told_of(self):
        hub = Hub(self)
        subscriber = self.start(hub, "readme/subscriber")
        pub = start_gimnet(self, hub, "pub", "robot/odom", "--wait", "1", stdin=subprocess.PIPE)

        def say(number, size=0):
            pub.popen.stdin.write(b"%d %s\n" % (number, b"x" * size))
            pub.popen.stdin.flush()
        say(0)
        self.until_accounted_for(subscriber, 1)
        subscriber.signal(signal.SIGSTOP)
        for number in range(1, 200):
            say(number, MIB)
        subscriber.signal(signal.SIGCONT)
        # What is lost at the end is known by the next message.
        said = itertools.count(200)
        wait_until(lambda: say(next(said)) or re.search(rb"^2\d\d ", subscriber.out, re.M), "a message of afterwards")
        self.assertGreater(self.until_accounted_for(subscriber, next(said))[1], 0)

    def test_a_message_that_is_too_large_is_told_of(self):
        hub = Hub(self)
        subscriber = self.start(hub, "readme/subscriber")
        adder = self.start(hub, "cpp/answer")
        robot = self.start(hub, "c/robot")
        with tempfile.NamedTemporaryFile() as file:
            file.write(b"1 " + b"x" * (65 * MIB))
            file.flush()
            for service in ("calc/add", "robot/drive"):
                self.wait_for_service(hub, service)
            asked = run_gimnet(hub, "request", "calc/add", "--file", file.name, "--timeout", "30")
            sent = run_gimnet(hub, "send", "robot/drive", "--file", file.name)
            for each in (asked, sent):
                self.assertEqual(each.code, 1, each.err)
                self.assertIn("67108864", each.err)
        robot.end()
        large = b"1 " + b"x" * (65 * MIB) + b"\n"
        self.publish(hub, [b"0 " + b"x" * (60 * MIB) + b"\n", large, b"2\n"])
        self.assertEqual(self.until_accounted_for(subscriber, 3), ([0, 2], 1))
        self.assertEqual((adder.popen.poll(), robot.out), (None, b""))

    # ---- the order of starts

    def test_programs_start_in_any_order(self):
        hub = Hub(self)
        takers = {"cpp/newest": "python/publish", "python/view": "c/camera"}
        for taker, giver in takers.items():
            taken = self.start(hub, taker)
            wait_until(lambda: hub.nodes(), taker)
            given = self.start(hub, giver)
            wait_until(lambda: taken.out.count(b"\n") >= 2, f"what {giver} gives {taker}; they said: {given.err}{taken.err}")
            given.end()
            taken.end()
        for program, service in (("cpp/ask", "calc/add"), ("python/ask", "calc/add"), ("c/drive", "robot/drive"), ("cpp/drive", "robot/drive")):
            alone = self.run_to_its_end(hub, program)
            self.assertEqual(alone.popen.returncode, 1, f"{program}: {alone.out}{alone.err}")
            self.assertIn(service, alone.err + alone.out.decode())

    def test_without_a_hub_each_program_says_so(self):
        hub = Hub(self)
        hub.process.end()
        for program in ("readme/publisher", "readme/subscriber", *(f"{page}/{name}" for page in ("cpp", "c", "python") for name in Page(page).programs)):
            with self.subTest(program):
                alone = self.run_to_its_end(hub, program)
                self.assertEqual(alone.popen.returncode, 1, alone.err)
                self.assertIn(hub.url, alone.err + alone.out.decode())
                self.assertNotIn("terminate called", alone.err)

    # ---- parts that go

    def test_a_command_is_carried_out_once_or_refused(self):
        for first, second, drivers in (("cpp/robot", "python/robot", ("c/drive", "cpp/drive")), ("python/robot", "c/robot", ("python/drive",))):
            with self.subTest(first=first, second=second):
                self.replace_a_robot(Hub(self), first, second, drivers)

    def replace_a_robot(self, hub, first, second, drivers):
        robot = self.start(hub, first)
        self.wait_for_service(hub, "robot/drive")
        for number, driver in enumerate(drivers, 1):
            self.assertEqual(self.run_to_its_end(hub, driver).popen.returncode, 0)
            wait_until(lambda: robot.out == b"drive 0.5 0.1\n" * number, f"the command of {driver}; it said: {robot.out}{robot.err}")
        robot.end()
        wait_until(lambda: b" away " in run_gimnet(hub, "nodes").out, "a robot that is away")
        for driver in drivers:
            refused = self.run_to_its_end(hub, driver)
            self.assertEqual(refused.popen.returncode, 1, driver)
            self.assertIn("away", refused.err + refused.out.decode(), driver)
        waiting = start_gimnet(self, hub, "send", "robot/drive", stdin=subprocess.PIPE).feed(b"waited\n")
        robot = self.start(hub, second)
        self.assertEqual(waiting.wait(), 0, waiting.err)
        self.assertEqual(self.run_to_its_end(hub, drivers[0]).popen.returncode, 0)
        wait_until(lambda: robot.out == b"drive waited\ndrive 0.5 0.1\n", f"two commands; it said: {robot.out}{robot.err}")
        robot.end()

    def test_each_part_is_killed_and_started_again(self):
        hub = Hub(self)
        day = Everyday(self, giver=hub, taker=hub)
        day.kill_and_start_again("adder")
        day.kill_and_start_again("publisher")
        day.kill_and_start_again("subscriber")
        day.kill_and_start_again("ask")
        day.kill_hub("giver")
        day.close()

    def test_a_hub_stands_still(self):
        hub = Hub(self)
        day = Everyday(self, giver=hub, taker=hub)
        day.stop_hub("giver", STOP_S)
        day.close()

    def test_commands_end_while_the_hub_stands_still(self):
        hub = Hub(self)
        commands = [start_gimnet(self, hub, *words, stdin=subprocess.PIPE) for words in
                    (("echo", "robot/odom"), ("recv", "--name", "B"), ("pub", "map/hall"), ("watch",))]
        wait_until(lambda: run_gimnet(hub, "nodes", "--all").out.count(b" connected ") == len(commands) + 1, "all commands")
        hub.process.signal(signal.SIGSTOP)
        self.addCleanup(hub.process.signal, signal.SIGCONT)
        joining = start_gimnet(self, hub, "nodes")
        wait_until(lambda: has_a_connection(joining), "a command that waits for its hub")
        for command in (*commands, joining):
            began = time.monotonic()
            command.signal(signal.SIGINT)
            self.assertIn(command.wait(), (130, -signal.SIGINT), command.err)
            self.assertLess(time.monotonic() - began, PROMPT_S, command.popen.args)
        hub.process.signal(signal.SIGCONT)

    # ---- two hubs

    def two_hubs(self):
        """The second one's link can be cut."""
        first = Hub(self, "--accept-links", hub_id=None)
        link = Proxy(self, first.port)
        return first, Hub(self, "--link", link.url, hub_id=None), link

    def test_a_burst_crosses_a_link(self):
        first, second, _ = self.two_hubs()
        subscriber = self.start(second, "readme/subscriber")
        self.publish(first, [b"%d\n" % number for number in range(20_000)])
        self.assertEqual(self.until_accounted_for(subscriber, 20_000)[1], 0)

    def test_with_a_link_in_between_each_part_goes(self):
        first, second, link = self.two_hubs()
        day = Everyday(self, giver=first, taker=second)
        events = [lambda name=name: day.kill_and_start_again(name) for name in PROGRAMS]
        for which in ("giver", "taker"):
            events += [lambda which=which: day.kill_hub(which), lambda which=which: day.stop_hub(which, STOP_S)]
        events.append(lambda: day.cut(link))
        seed = int(os.environ.get("GIMNET_STRESS_SEED", random.randrange(1 << 32)))
        print(f"GIMNET_STRESS_SEED={seed}", flush=True)
        draw = random.Random(seed)
        for event in draw.sample(events, len(events)) + draw.choices(events, k=MORE_EVENTS):
            event()
        day.close()


if __name__ == "__main__":
    unittest.main()
