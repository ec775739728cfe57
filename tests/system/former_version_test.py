#!/usr/bin/env python3
"""Programs of version 0.9.0 beside those of today: nodes of either at hubs of either, also with a link between both hubs. All that
0.9.0 could do goes on; what came later need not work there.

GIMNET_FORMER_BIN names a folder with tcphub, gimnet and examples of that version; else it is built from this repository."""

import itertools
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import unittest

from support.processes import BIN, ROOT, Hub, Process
from support.proxy import Proxy
from support.waiting import wait_until

sys.path.insert(0, str(ROOT / "perf"))
from driver import against  # noqa: E402

FORMER = "108bb08f493d"  # the last commit of 0.9.0
SKIPPED = 77
LINES = b"".join(b"%d\n" % number for number in range(2000))
PICTURE = b"p" * 4_000_000 + b"\n"


def former_bin():
    named = os.environ.get("GIMNET_FORMER_BIN")
    if named:
        return pathlib.Path(named)
    return against.build_version(ROOT, FORMER, ("tcphub", "gimnet", "all_examples"))[1] / "bin"


class Site:
    """Where one of two parties is: the programs of a version, and the hub that they use."""

    def __init__(self, test, programs, hub):
        self.test, self.programs, self.proxy = test, programs, Proxy(test, hub.port)
        self.url = self.proxy.url

    def start(self, program, *arguments, **pipes):
        process = Process([self.programs / program, *arguments], env={"GIMNET_HUB": self.url}, **pipes)
        self.test.addCleanup(process.end)
        return process

    def run(self, program, *arguments, data=b""):
        process = self.start(program, *arguments, stdin=subprocess.PIPE).feed(data)
        process.code = process.wait()
        return process

    def ask(self, *arguments):
        """What `gimnet --json` prints; None where it fails."""
        asked = self.run("gimnet", "--json", *arguments)
        return json.loads(asked.out) if asked.code == 0 else None

    def wait_for(self, what, name):
        """`what`: nodes or services."""
        wait_until(lambda: any(each["name"] == name and each["state"] == "connected" for each in self.ask(what) or ()),
                   f"{name} among the {what}")


class FormerVersion(unittest.TestCase):
    former = None

    def hub(self, programs, *arguments, hub_id=1):
        return Hub(self, *arguments, hub_id=hub_id, program=programs / "tcphub")

    def test_nodes_at_one_hub(self):
        versions = {"0.9.0": self.former, "today": BIN}
        for names in itertools.product(versions, repeat=3):
            if len(set(names)) == 1:
                continue
            with self.subTest(hub=names[0], giver=names[1], taker=names[2]):
                programs = [versions[name] for name in names]
                hub = self.hub(programs[0])
                self.all_flows(hub, Site(self, programs[1], hub), Site(self, programs[2], hub))

    def test_nodes_at_two_hubs(self):
        versions = {"0.9.0": self.former, "today": BIN}
        for names in itertools.product(versions, repeat=4):
            if len(set(names[:2])) == 1:
                continue
            with self.subTest(hub=names[0], dialler=names[1], giver=names[2], taker=names[3]):
                programs = [versions[name] for name in names]
                first = self.hub(programs[0], "--accept-links")
                second = self.hub(programs[1], "--link", first.url, hub_id=2)
                self.all_flows(first, Site(self, programs[2], first), Site(self, programs[3], second))

    def all_flows(self, hub, giver, taker):
        for flow in (self.lists, self.services, self.camera, self.messages, self.commands, self.requests, self.refusals, self.breaks, self.provider_killed):
            with self.subTest(flow.__name__):
                flow(giver, taker)
        with self.subTest("hub_killed"):
            self.hub_killed(hub, giver, taker)
        self.doCleanups()

    def lists(self, giver, taker):
        receiver = giver.start("gimnet", "recv", "--name", "B")
        taker.wait_for("nodes", "B")
        for words in (("status", "--all"), ("hubs",), ("links",), ("graph",), ("routes", "B"), ("ping", "B", "-c", "2"), ("trace", "B", "-c", "2")):
            asked = taker.run("gimnet", *words)
            self.assertEqual(asked.code, 0, f"{words}: {asked.err}")
        watch = taker.start("gimnet", "watch", "--json")
        wait_until(lambda: b'"present"' in watch.out, "what is there")
        receiver.signal(signal.SIGINT)
        receiver.wait()
        wait_until(lambda: b'"left"' in watch.out, f"a node that left: {watch.out}")
        watch.end()

    def services(self, giver, taker):
        for delivery in ("stream", "sync:64"):
            echo = taker.start("gimnet", "echo", "robot/odom", "--raw", "-n", "2000")
            pub = giver.run("gimnet", "pub", "robot/odom", "--delivery", delivery, "--rate", "4000", "--wait", "1", data=LINES)
            self.assertEqual(pub.code, 0, pub.err)
            got = [int(line) for line in echo.out.splitlines()]
            self.assertEqual(got, sorted(set(got)))
            if delivery == "stream":
                self.assertEqual((echo.wait(), echo.out), (0, LINES), echo.err)
            echo.end()
        keeper = giver.start("gimnet", "pub", "map/hall", "--retain", "--stay", stdin=subprocess.PIPE).feed(PICTURE)
        taker.wait_for("services", "map/hall")
        echo = taker.run("gimnet", "echo", "map/hall", "--raw", "-n", "1")
        self.assertEqual((echo.code, echo.out == PICTURE), (0, True), echo.err)
        # Two subscribers behind the giver's own hub count at least as one.
        echoes = [taker.start("gimnet", "echo", "map/hall") for _ in range(2)]
        wait_until(lambda: any(each["name"] == "map/hall" and each["subscribers"] >= 1 for each in giver.ask("services")), "a subscriber")
        for each in (*echoes, keeper):
            each.end()

    def camera(self, giver, taker):
        camera = giver.start("examples/camera")
        rests = b"camera: nobody watches\n"
        wait_until(lambda: camera.out == rests, f"it rests; it said: {camera.err}")
        viewer = taker.start("examples/viewer", "50")
        wait_until(lambda: viewer.out.count(b", 307200 bytes, ") >= 3, f"pictures; {viewer.err}")
        viewer.end()
        wait_until(lambda: camera.out.count(rests) == 2, f"it rests again; {camera.out}")
        camera.end()

    def messages(self, giver, taker):
        receiver = giver.start("gimnet", "recv", "--name", "B", "--raw", "-n", "2001")
        taker.wait_for("nodes", "B")
        sent = taker.run("gimnet", "send", "B", data=LINES + PICTURE)
        self.assertEqual(sent.code, 0, sent.err)
        self.assertEqual((receiver.wait(), receiver.out == LINES + PICTURE), (0, True), receiver.err)

    def commands(self, giver, taker):
        robot = giver.start("examples/robot")
        taker.wait_for("services", "robot/drive")
        sent = taker.run("gimnet", "send", "robot/drive", data=b"0 0\n")
        self.assertEqual(sent.code, 0, sent.err)
        pilot = taker.run("examples/pilot", "2", "0", "1")
        self.assertEqual((pilot.code, pilot.err), (0, ""))
        self.assertIn(b"76800 bytes", pilot.out)
        robot.end()
        # It is away, or gone: a command is refused or lost, which is said, or waits for a robot that comes.
        again = taker.start("gimnet", "send", "robot/drive", stdin=subprocess.PIPE).feed(b"1 0\n")
        robot = giver.start("examples/robot")
        self.assertIn(again.wait(), (0, 1, 4), again.err)
        wait_until(lambda: taker.run("gimnet", "send", "robot/drive", data=b"1 0\n").code == 0, "a robot that obeys")
        robot.end()

    def requests(self, giver, taker):
        adder = giver.start("examples/adder")
        taker.wait_for("services", "calc/add")
        asked = taker.run("examples/ask", data=b"1 2\n" * 100)
        self.assertEqual((asked.code, asked.out), (0, b"1 2: 3.000000\n" * 100), asked.err)
        failed = taker.run("gimnet", "request", "calc/add", "an apple")
        self.assertEqual(failed.code, 1, failed.err)
        adder.end()
        late = taker.run("gimnet", "request", "calc/add", "1 2", "--timeout", "0.5")
        self.assertIn(late.code, (4, 5), late.err)
        adder = giver.start("examples/adder")
        asked = wait_until(lambda: next((each for each in [taker.run("examples/ask", data=b"1 2\n")] if each.code == 0), None), "the next one")
        self.assertEqual(asked.out, b"1 2: 3.000000\n")
        adder.end()

    def refusals(self, giver, taker):
        nobody = taker.run("gimnet", "send", "nobody", data=b"1\n")
        self.assertEqual(nobody.code, 4, nobody.err)
        small = giver.start("gimnet", "recv", "--name", "small", "--max-size", "1000")
        taker.wait_for("nodes", "small")
        large = taker.run("gimnet", "send", "small", data=b"x" * 5000 + b"\n")
        self.assertEqual(large.code, 1, large.err)
        self.assertIn("at most 1000 bytes", large.err)
        small.end()

    def breaks(self, giver, taker):
        """The connection of a sender with a name breaks again and again: each line comes once."""
        receiver = giver.start("gimnet", "recv", "--name", "R", "--raw", "-n", "2000")
        taker.wait_for("nodes", "R")
        sender = taker.start("gimnet", "send", "R", "--name", "A", stdin=subprocess.PIPE)
        for begin in range(0, len(LINES), 1000):
            sender.popen.stdin.write(LINES[begin:begin + 1000])
            sender.popen.stdin.flush()
            wait_until(lambda: receiver.out, f"the first lines; it said: {sender.err}")
            taker.proxy.drop_all()
        sender.popen.stdin.close()
        self.assertEqual(sender.wait(), 0, sender.err)
        self.assertEqual((receiver.wait(), receiver.out == LINES), (0, True), receiver.err)

    def provider_killed(self, giver, taker):
        subscriber = taker.start("examples/subscriber")
        for _ in range(2):
            publisher = giver.start("examples/publisher")
            before = subscriber.out.count(b"\n")
            wait_until(lambda: subscriber.out.count(b"\n") >= before + 3, f"messages; they said {publisher.err}{subscriber.err}")
            publisher.end()

    def hub_killed(self, hub, giver, taker):
        subscriber = taker.start("examples/subscriber")
        publisher = giver.start("examples/publisher")
        wait_until(lambda: subscriber.out.count(b"\n") >= 3, f"messages; they said {publisher.err}{subscriber.err}")
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        before = subscriber.out.count(b"\n")
        hub.again(self)
        wait_until(lambda: subscriber.out.count(b"\n") >= before + 3, f"messages by the new one; {publisher.err}{subscriber.err}")
        steps = [float(step) for step in re.findall(rb"x (\S+) y 0", subscriber.out)]
        self.assertEqual(steps, sorted(set(steps)))
        publisher.end()
        subscriber.end()


if __name__ == "__main__":
    try:
        FormerVersion.former = former_bin()
    except against.BuildError as error:
        print(f"SKIPPED: version 0.9.0 cannot be built: {error}", file=sys.stderr)
        sys.exit(SKIPPED)
    unittest.main()
