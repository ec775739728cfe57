#!/usr/bin/env python3
"""Windows of subscriptions that must not leak, and the last message for who comes late. Judged by counts and sequence numbers,
not by time."""

import json
import os
import pathlib
import struct
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

from rate_proxy import RateProxy
from support.delivery import STREAM_DELIVERY, SYNC_DELIVERY, Provider, advertise, subscribe
from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import wait_until
from support.wire import CREDIT, FLOW, GROUP, MISSED, NS, Client, number, text

FULL = os.environ.get("GIMNET_STRESS") == "full"


class Latest(unittest.TestCase):
    LINES = 500

    def test_echo_shows_the_newest_however_slowly_its_output_is_read(self):
        for target in ("camera/pose", "camera/*"):
            with self.subTest(target=target):
                hub = Hub(self)
                reading, writing = os.pipe()
                echo = start_gimnet(self, hub, "echo", target, "--raw", stdout=writing)
                os.close(writing)
                lines = b"".join(b"%04096d\n" % number for number in range(self.LINES))
                pub = start_gimnet(self, hub, "pub", "camera/pose", "--delivery", "latest", "--wait", "1",
                                   "--rate", "1000", stdin=subprocess.PIPE).feed(lines)
                self.assertEqual(pub.wait(), 0, pub.err)
                with open(reading, "rb") as output:
                    shown = [int(output.readline())]
                    while shown[-1] != self.LINES - 1:
                        shown.append(int(output.readline()))
                self.assertLess(len(shown), self.LINES / 4, "as many as the pipe holds, and some that were under way")
                self.assertEqual(shown, sorted(set(shown)))
                echo.signal(2)
                self.assertEqual(echo.wait(), 130, echo.err)

    def test_who_publishes_is_told_at_the_end_what_subscribers_missed(self):
        for delivery, said in (("stream", True), ("latest", False)):
            with self.subTest(delivery=delivery):
                hub = Hub(self)
                pub = start_gimnet(self, hub, "pub", "robot/odom", "--delivery", delivery, "--wait", "1",
                                   stdin=subprocess.PIPE)
                hub.wait_for_node("robot")
                viewer = Client(self, hub).join()
                group = viewer.ask(NS, 10, text(3, "robot/odom"))[4]
                missed = bytes([MISSED, 0, 0, 0]) + struct.pack("<IQ", group, 54)
                viewer.send(viewer.frame(0, missed, kind=FLOW))

                def told(hub=hub):
                    services = json.loads(run_gimnet(hub, "services", "robot/odom", "--json").out)
                    return services and services[0]["missed"] == 54
                wait_until(told, "the hub's count")
                pub.feed(b"one\n")
                self.assertEqual(pub.wait(), 0, pub.err)
                self.assertEqual("subscribers missed 54 or more" in pub.err, said, pub.err)

    def test_the_hub_shows_who_misses_how_many(self):
        hub = Hub(self)
        reading, writing = os.pipe()
        start_gimnet(self, hub, "echo", "camera/pose", "--raw", stdout=writing)
        os.close(writing)
        pub = start_gimnet(self, hub, "pub", "camera/pose", "--delivery", "latest", "--wait", "1", "--rate", "1000",
                           stdin=subprocess.PIPE)
        pub.popen.stdin.write(b"".join(b"%04096d\n" % number for number in range(self.LINES)))
        pub.popen.stdin.flush()
        with open(reading, "rb") as output:
            shown = [int(output.readline())]
            while shown[-1] != self.LINES - 1:
                shown.append(int(output.readline()))
            # Of those before the first one that was shown some may have come, and been overwritten.
            missed, missed_at_most = self.LINES - shown[0] - len(shown), self.LINES - len(shown)
            self.assertGreater(missed, 0)

            def service():
                return json.loads(run_gimnet(hub, "services", "camera/pose", "--json").out)[0]
            wait_until(lambda: missed <= service()["missed"] <= missed_at_most, "the hub to know all")

            def is_named():
                slow = [(each["id"], each["missed"]) for each in hub.status()["connections"] if each["missed"]]
                return slow == [(service()["missed_most"], service()["missed"])]
            wait_until(is_named, "the connection that missed them")
            told = service()
            self.assertIn(f"{told['missed']} (most: {told['missed_most']})", run_gimnet(hub, "services").out.decode())


class Windows(unittest.TestCase):
    def test_a_window_of_less_and_a_depth(self):
        for delivery, window in ((SYNC_DELIVERY, 4), (STREAM_DELIVERY, None)):
            with self.subTest(delivery=delivery):
                self.check_a_window(delivery, window)

    def test_a_window_that_comes_back_begins_to_count_anew(self):
        hub = Hub(self)
        provider = Provider(self, hub, STREAM_DELIVERY)
        client = Client(self, hub).join()
        for window in (1, 0, 1):
            self.assertEqual(subscribe(client, "A/B", window=window).get(10, 0), window)
            first = provider.publish(10)
            provider.publish(10)
            wait_until(lambda: hub.counter("accepted") == provider.sequence, "both are at the hub")
            came = 1 if window else 2
            for number in range(first, first + came):
                got = client.next_where(lambda frame: frame.kind == GROUP)
                self.assertEqual(struct.unpack_from("<I", got.payload, 12)[0], number)
            if window:
                client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 1), kind=FLOW))
                got = client.next_where(lambda frame: frame.kind == GROUP)
                self.assertEqual(struct.unpack_from("<I", got.payload, 12)[0], first + 1)

    def check_a_window(self, delivery, window):
        hub = Hub(self)
        provider = Provider(self, hub, delivery, window)
        client = Client(self, hub).join()
        self.assertEqual(subscribe(client, "A/B", window=2, depth=3)[10], 2)
        for _ in range(9):
            provider.publish(10)

        def take():
            return struct.unpack_from("<I", client.next_where(lambda got: got.kind == GROUP).payload, 12)[0]

        self.assertEqual([take(), take()], [1, 2])
        wait_until(lambda: hub.counter("accepted") == 9, "all are at the hub")
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 2), kind=FLOW))
        self.assertEqual([take(), take()], [7, 8], "the newest three were held")
        # A lying total is what was sent, and one for an unknown group is nothing; both are counted.
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 1 << 60), kind=FLOW))
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group + 1, 1), kind=FLOW))
        self.assertEqual(take(), 9)
        wait_until(lambda: hub.counter("bad_credits") == 2, "two CREDITs that cannot be")
        provider.publish(10)
        self.assertEqual(take(), 10)
        provider.publish(10)
        provider.publish(10)
        client.send(client.frame(0, struct.pack("<B3xIQ", CREDIT, provider.group, 6), kind=FLOW))
        self.assertEqual([take(), take()], [11, 12])
        hub.expect_ledger(self, accepted=provider.sequence, delivered=client.frames_got,
                          dropped={"replaced": provider.sequence - client.frames_got})

    def test_numbers_out_of_range_are_refused_with_words(self):
        hub = Hub(self)
        client = Client(self, hub).join("A")
        for answer in (advertise(client, "B", SYNC_DELIVERY, 1025), subscribe(client, "X/Y", window=1025),
                       subscribe(client, "X/Y", depth=65), subscribe(client, "X/Y", depth=0),
                       subscribe(client, "X/Y", rate_hz=1000.5), subscribe(client, "X/Y", rate_hz=-1.0),
                       subscribe(client, "X/Y", rate_hz=float("nan"))):
            self.assertEqual(answer[1], 2, answer)
            self.assertIn("must be", answer[2])
        self.assertEqual(advertise(client, "B", STREAM_DELIVERY, 2)[1], 2)
        self.assertEqual(client.ask(NS, 7, text(3, "B") + number(7, 2, 3))[1], 2)
        self.assertEqual(advertise(client, "B", SYNC_DELIVERY, 1024)[1], 0)
        self.assertEqual(subscribe(client, "X/Y", window=1024, depth=64, rate_hz=1000.0)[1], 0)

    def test_no_window_leaks_when_the_connection_flaps(self):
        """`gimnet echo` behind a proxy that cuts, of a provider that never stops."""
        hub = Hub(self, shards=2)
        provider = Provider(self, hub, SYNC_DELIVERY, 1)
        proxy = RateProxy(hub.port)
        self.addCleanup(proxy.close)
        echo = start_gimnet(self, proxy, "echo", "A/B", "--raw")
        wait_until(lambda: provider.publish() and echo.out_size > 0, "the first message")
        for _ in range(1000 if FULL else 30):
            before = (proxy.accepted, echo.out_size)
            wait_until(lambda: proxy.cut(), "a connection to cut", pause_s=0.001)
            provider.publish()

            def goes_on():
                provider.publish()
                return proxy.accepted > before[0] and echo.out_size > before[1]

            wait_until(goes_on, "messages after the cut")
        for _ in range(20):
            before = echo.out_size
            provider.publish()
            wait_until(lambda: echo.out_size > before, "one message, one window")
        self.assertEqual(hub.counter("bad_credits"), 0)
        # What was on its way when a connection was cut counts as delivered, and not all of it was read.
        wait_until(lambda: hub.counter("accepted") == provider.client.frames_sent, "all that was published")
        ledger = hub.quiet_status(self)["ledger"]
        self.assertEqual((ledger["copies"], ledger["queued"]), (0, 0))
        self.assertGreaterEqual(ledger["delivered"], echo.out.count(b"\n"))
        self.assertLessEqual(ledger["delivered"], provider.sequence)


class Retained(unittest.TestCase):
    def test_a_late_subscriber_gets_the_last_first(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                hub = Hub(self, shards=shards)
                provider = Provider(self, hub, STREAM_DELIVERY, retain=True)
                for _ in range(5):
                    provider.publish(10)
                wait_until(lambda: hub.counter("accepted") == 5, "they are at the hub")
                late = run_gimnet(hub, "echo", "A/B", "-n", "1", "--raw")
                self.assertEqual((late.code, late.out), (0, b"5.........\n"), late.err)
                self.assertEqual(run_gimnet(hub, "echo", "A/B", "-n", "1", "--raw").out, b"5.........\n")
                # Nobody was there for the five; the last one was copied for each of the two who came.
                hub.expect_ledger(self, accepted=provider.client.frames_sent, copies=2, delivered=2,
                                  dropped={"no_subscriber": 5})


if __name__ == "__main__":
    unittest.main()
