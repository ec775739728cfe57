#!/usr/bin/env python3
"""The hub's process stands still for longer than its timers (SIGSTOP) and goes on: what peers did meanwhile counts."""

import json
import pathlib
import signal
import subprocess
import time
import unittest

from support.processes import Hub, start_gimnet, start_recv
from support.waiting import wait_until
from support.wire import NS, OPENING, WELCOME, Client, hello, text

ADVERTISE = 7
TIME_S = 8
SEND_S = 6


def stop(hub):
    """Returns when none of its threads runs any more."""
    hub.process.signal(signal.SIGSTOP)
    threads = pathlib.Path(f"/proc/{hub.process.popen.pid}/task")

    def stands():
        return all((thread / "stat").read_text().rsplit(")", 1)[1].split()[0] == "T" for thread in threads.iterdir())
    wait_until(stands, "a hub that stands still")


class Stopped(unittest.TestCase):
    def test_who_says_hello_or_comes_back_meanwhile_is_not_too_late(self):
        hub = Hub(self, "--limit", f"grace_ms={TIME_S * 1000}", "--limit", f"handshake_ms={TIME_S * 1000}", "--limit",
                  "silent_ms=600000")
        while True:
            began = time.monotonic()
            provider = Client(self, hub).join("K")
            group = provider.ask(NS, ADVERTISE, text(3, "odom"))[3]
            provider.socket.close()
            wait_until(lambda: any(node["name"] == "K" and not node["connected"] for node in hub.nodes()), "K away")
            stranger = Client(self, hub)
            Client(self, hub).join()  # the hub takes them in order: it has the stranger, who has said nothing yet
            stop(hub)
            if time.monotonic() - began < TIME_S / 4:
                break
            hub.process.signal(signal.SIGCONT)  # too slow a moment to say that nothing had run out before it stood
        stranger.send(OPENING + hello("S"))
        again = Client(self, hub)
        again.send(OPENING + hello("K", token=provider.welcome[2]))
        wait_until(lambda: time.monotonic() - began > TIME_S + 1, "the end of all times")
        hub.process.signal(signal.SIGCONT)
        self.assertEqual(stranger.first_answer().operation, WELCOME)
        answer = again.first_answer()
        self.assertEqual((answer.operation, answer.dst), (WELCOME, provider.id))
        # Its session was not over, nor its service: that is where its subscribers know it.
        again.id = answer.dst
        self.assertEqual(again.ask(NS, ADVERTISE, text(3, "odom"))[3], group)

    def test_send_waits_for_it_and_loses_nothing(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B")
        sender = start_gimnet(self, hub, "send", "B", "--json", stdin=subprocess.PIPE)
        self.addCleanup(hub.process.signal, signal.SIGCONT)

        def say(line):
            sender.popen.stdin.write(line)
            sender.popen.stdin.flush()
        say(b"one\n")
        wait_until(lambda: receiver.out == b"one\n", "the first line")
        began = time.monotonic()
        stop(hub)
        say(b"two\n")
        wait_until(lambda: "the connection broke" in sender.err, "a sender that hears nothing")
        wait_until(lambda: time.monotonic() - began > SEND_S, "a hub that stood still for longer than a sender waits for a word")
        hub.process.signal(signal.SIGCONT)
        sender.feed(b"three\n")
        self.assertEqual(sender.wait(), 0, sender.err)
        self.assertEqual(json.loads(sender.out), {"sent": 3, "acknowledged": 3, "lost": 0, "waiting": 0})
        wait_until(lambda: receiver.out == b"one\ntwo\nthree\n", "all lines")

    def test_send_ends_where_the_hub_does_not_know_it_any_more(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B")
        sender = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE)
        sender.popen.stdin.write(b"one\n")
        sender.popen.stdin.flush()
        wait_until(lambda: receiver.out == b"one\n", "the first line")
        stop(hub)
        wait_until(lambda: "the connection broke" in sender.err, "a sender that hears nothing")
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        self.assertEqual(sender.wait(), 3, sender.err)
        self.assertIn("lost the connection to the hub", sender.err)
        self.assertIn("1 of 1 messages were acknowledged, and the rest of the input was not sent", sender.err)


if __name__ == "__main__":
    unittest.main()
