#!/usr/bin/env python3
"""Services and names through `gimnet`, and through a raw client that looks at the frames."""

import json
import signal
import struct
import subprocess
import time
import unittest

from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.proxy import Proxy
from support.waiting import wait_until
from support.wire import FLAG_KEYED, GROUP, NS, Client, number, text

DATA = 0  # operation of GIMI
KEY = 8


def subscribers_of(hub, service):
    found = json.loads(run_gimnet(hub, "services", service, "--json").out)
    return found[0]["subscribers"] if found else None


class Services(unittest.TestCase):
    def test_what_is_published_is_echoed(self):
        for shards in (1, 2):
            with self.subTest(shards=shards):
                hub = Hub(self, shards=shards)
                echo = start_gimnet(self, hub, "echo", "robot/odom", "-n", "1000", "--raw", "--shard", "0")
                data = b"".join(b"line %d\n" % number for number in range(1000))
                pub = run_gimnet(hub, "pub", "robot/odom", "--wait", "1", "--shard", str(shards - 1), data=data)
                self.assertEqual((pub.code, echo.wait()), (0, 0), pub.err)
                self.assertEqual(echo.out, data)
                hub.expect_ledger(self, accepted=1000, delivered=1000)

    def test_publishing_ends_without_waiting_for_the_keep_alive(self):
        hub = Hub(self, "--limit", "keep_alive_ms=60000", "--limit", "silent_ms=120000")  # `pub` waits 10 s at most
        echo = start_gimnet(self, hub, "echo", "robot/odom", "-n", "2", "--raw")
        pub = run_gimnet(hub, "pub", "robot/odom", "--wait", "1", data=b"one\ntwo\n")
        self.assertEqual((pub.code, echo.wait(), echo.out), (0, 0, b"one\ntwo\n"), pub.err)

    def test_a_viewer_that_was_killed_is_no_subscriber(self):
        hub = Hub(self, "--limit", "grace_ms=3600000")
        viewer = start_gimnet(self, hub, "echo", "robot/odom", "--raw")
        pub = start_gimnet(self, hub, "pub", "robot/odom", "--stay", stdin=subprocess.PIPE).feed(b"")
        wait_until(lambda: subscribers_of(hub, "robot/odom") == 1, "the viewer")
        viewer.signal(signal.SIGKILL)
        viewer.wait()
        wait_until(lambda: subscribers_of(hub, "robot/odom") == 0, "the end of the viewer")
        pub.signal(signal.SIGINT)
        pub.wait()
        waiting = start_gimnet(self, hub, "pub", "robot/odom", "--wait", "1", stdin=subprocess.PIPE).feed(b"one\n")
        wait_until(lambda: subscribers_of(hub, "robot/odom") == 0, "the service")
        echo = run_gimnet(hub, "echo", "robot/odom", "-n", "1", "--raw")
        self.assertEqual((echo.code, echo.out, waiting.wait()), (0, b"one\n", 0), waiting.err)

    def test_the_last_line_stays_for_who_comes_late(self):
        hub = Hub(self)
        pub = start_gimnet(self, hub, "pub", "robot/map", "--retain", "--stay", "--json",
                           stdin=subprocess.PIPE).feed(b"old\nnew\n")
        wait_until(lambda: "stays until Ctrl-C" in pub.err, "the end of its input")
        self.assertEqual(json.loads(pub.out), {"published": 2, "subscribers": 0})
        echo = run_gimnet(hub, "echo", "robot/map", "-n", "1", "--raw")
        self.assertEqual((echo.code, echo.out), (0, b"new\n"), echo.err)
        hub.expect_ledger(self, accepted=2, copies=1, delivered=1, dropped={"no_subscriber": 2})
        pub.signal(2)
        self.assertEqual(pub.wait(), 130, pub.err)

    def test_the_last_line_stays_when_the_hub_is_killed_and_started_again(self):
        hub = Hub(self)
        pub = start_gimnet(self, hub, "pub", "robot/map", "--retain", "--stay",
                           stdin=subprocess.PIPE).feed(b"old\nnew\n")
        wait_until(lambda: "stays until Ctrl-C" in pub.err, "the end of its input")
        subscriber = start_gimnet(self, hub, "echo", "robot/map", "--raw")
        wait_until(lambda: subscriber.out == b"new\n", "the last line")
        for _ in range(2):
            hub.process.signal(signal.SIGKILL)
            hub.process.wait()
            hub = hub.again(self)
            echo = run_gimnet(hub, "echo", "robot/map", "-n", "1", "--raw")
            self.assertEqual((echo.code, echo.out), (0, b"new\n"), echo.err)
        hub.wait_for_node("robot")
        self.assertEqual(subscriber.out, b"new\n", "who had it gets it once")
        pub.signal(signal.SIGINT)
        self.assertEqual(pub.wait(), 130, pub.err)

    def test_each_map_of_a_provider_that_is_killed_and_started_again_comes(self):
        hub = Hub(self)
        subscriber = start_gimnet(self, hub, "echo", "robot/map", "--raw")
        maps = [b"map %d\n" % number for number in range(5)]
        for number, content in enumerate(maps):
            pub = start_gimnet(self, hub, "pub", "robot/map", "--retain", "--stay", stdin=subprocess.PIPE).feed(content)
            wait_until(lambda: len(subscriber.out.splitlines()) > number, f"map {number}")
            pub.signal(signal.SIGKILL)
            pub.wait()
        self.assertEqual(subscriber.out, b"".join(maps))
        self.assertNotIn("did not come", subscriber.err)

    def test_who_publishes_a_line_that_is_too_large_to_be_kept_is_told(self):
        most = 1 << 20
        hub = Hub(self, "--limit", f"retained_message_bytes={most}")
        subscriber = start_gimnet(self, hub, "echo", "robot/map", "--raw")
        for size, kept in ((most, True), (most + 1, False)):
            pub = start_gimnet(self, hub, "pub", "robot/map", "--retain", "--stay", "--wait", "1",
                               stdin=subprocess.PIPE).feed(b"x" * size + b"\n")
            wait_until(lambda: "stays until Ctrl-C" in pub.err, "the end of its input")
            said = f"robot/map was published, but: the hub does not keep the message of {size} bytes" in pub.err
            self.assertEqual(said, not kept, pub.err)
            self.assertEqual(hub.counter("not_retained") != 0, not kept, "what it says is what the hub does")
            pub.signal(signal.SIGINT)
            self.assertEqual(pub.wait(), 130, pub.err)
        wait_until(lambda: subscriber.out_size == 2 * most + 3, "both lines")

    def test_who_publishes_more_than_the_hub_has_room_for_is_told(self):
        hub = Hub(self, "--limit", "retained_budget_bytes=2000")
        large = start_gimnet(self, hub, "pub", "robot/map", "--retain", "--stay", stdin=subprocess.PIPE).feed(b"x" * 1000 + b"\n")
        wait_until(lambda: "stays until Ctrl-C" in large.err, "the end of its input")
        self.assertNotIn("does not keep", large.err)
        other = start_gimnet(self, hub, "pub", "other/map", "--retain", "--stay", stdin=subprocess.PIPE).feed(b"x" * 1000 + b"\n")
        wait_until(lambda: "stays until Ctrl-C" in other.err, "the end of its input")
        self.assertNotIn("does not keep", other.err)
        third = start_gimnet(self, hub, "pub", "third/map", "--retain", "--stay", stdin=subprocess.PIPE).feed(b"x\n")
        wait_until(lambda: "the hub does not keep the last message of third/map" in third.err, "the word of the hub")
        for pub in (large, other, third):
            pub.signal(signal.SIGINT)
            self.assertEqual(pub.wait(), 130, pub.err)

    def test_terms_that_the_hub_forbids_are_wrong_arguments(self):
        hub = Hub(self)
        pub = start_gimnet(self, hub, "pub", "robot/odom", stdin=subprocess.PIPE)
        hub.wait_for_node("robot")
        for words, said in ((["echo", "robot/odom", "--depth", "65"], "depth is over 64"),
                            (["echo", "nobody/here", "--window", "1025"], "window is over 1,024"),
                            (["echo", "nobody/*", "--window", "1025"], "window is over 1,024"),
                            (["pub", "a/b", "--delivery", "sync:1025"], "n of delivery sync(n) must be 1 to 1024;")):
            tool = run_gimnet(hub, *words, data=b"x\n")
            self.assertEqual((tool.code, tool.out, said in tool.err), (2, b"", True), tool.err)
        pub.feed(b"")

    def test_json_of_a_message(self):
        hub = Hub(self)
        echo = start_gimnet(self, hub, "echo", "a/b/c", "-n", "2", "--json")
        pub = run_gimnet(hub, "pub", "a/b/c", "--wait", "1", "--type", "5", "--instance", "9",
                         data=b'say "hi"\n\xff\n')
        self.assertEqual((pub.code, echo.wait()), (0, 0), pub.err)
        first, second = (json.loads(line) for line in echo.out.splitlines())
        self.assertEqual((first["text"], first["type"], first["instance"], first["sequence"], first["service"]),
                         ('say "hi"', 5, 9, 1, "a/b/c"))
        self.assertEqual(second["text_hex"], "ff")
        self.assertGreaterEqual(first["age_us"], 0)

    def test_echo_says_what_did_not_come(self):
        hub = Hub(self)
        provider = Client(self, hub).join("r")
        group = provider.ask(NS, 7, text(3, "s"))[3]
        lines = start_gimnet(self, hub, "echo", "r/s", "-n", "2")
        objects = start_gimnet(self, hub, "echo", "r/s", "-n", "2", "--json")
        paced = start_gimnet(self, hub, "echo", "r/s", "-n", "2", "--rate", "1000")
        wait_until(lambda: subscribers_of(hub, "r/s") == 3, "the subscribers")
        for sequence in (1, 943):
            data = struct.pack("<IIBBH", 1, sequence, DATA, 0, 0) + b"x"
            provider.send(provider.frame(group, bytes(KEY) + data, kind=GROUP, flags=FLAG_KEYED))
            wait_until(lambda: paced.out, "a message, before the next one could take its place")
        for tool in (lines, objects, paced):
            self.assertEqual(tool.wait(), 0, tool.err)
        said = ("gimnet: 941 messages of r/s did not come: this reader was too slow, or the sender's connection or "
                "a link between hubs broke (`gimnet status` counts what the hub dropped)\n")
        self.assertEqual((lines.err, objects.err, paced.err), (said, said, ""))
        self.assertEqual([json.loads(line)["missed"] for line in objects.out.splitlines()], [0, 941])
        hub.expect_ledger(self, accepted=provider.frames_sent, copies=4, delivered=6)

    def test_echo_blames_a_broken_connection_for_what_did_not_come_across_it(self):
        hub = Hub(self)
        proxy = Proxy(self, hub.port)
        provider = Client(self, hub).join("r")
        group = provider.ask(NS, 7, text(3, "s"))[3]
        echo = start_gimnet(self, proxy, "echo", "r/s", "-n", "2", "--raw")
        wait_until(lambda: subscribers_of(hub, "r/s") == 1, "the subscriber")

        def publish(sequence):
            data = struct.pack("<IIBBH", 1, sequence, DATA, 0, 0) + b"x"
            provider.send(provider.frame(group, bytes(KEY) + data, kind=GROUP, flags=FLAG_KEYED))
        publish(1)
        wait_until(lambda: echo.out, "the first message")
        proxy.drop_all()
        wait_until(lambda: "connected again" in echo.err, "its new connection")
        sequences = iter(range(943, 1 << 20))

        def is_over():
            publish(next(sequences))
            return echo.popen.poll() is not None
        wait_until(is_over, "a message behind the new subscription")
        self.assertEqual(echo.wait(), 0, echo.err)
        self.assertRegex(echo.err, r"[0-9]+ messages of r/s did not come: the connection to the hub was broken\n")
        self.assertNotIn("too slow", echo.err)

    def test_a_subscription_survives_its_provider(self):
        hub = Hub(self)
        echo = start_gimnet(self, hub, "echo", "robot/odom", "-n", "2", "--raw")
        for line in (b"before\n", b"after\n"):
            self.assertEqual(run_gimnet(hub, "pub", "robot/odom", "--wait", "1", data=line).code, 0)
        self.assertEqual(echo.wait(), 0)
        self.assertEqual(echo.out, b"before\nafter\n")
        hub.expect_ledger(self, accepted=2, delivered=2)

    def test_services_and_nodes_are_listed(self):
        hub = Hub(self)
        pub = start_gimnet(self, hub, "pub", "robot/scan", "--delivery", "latest", stdin=subprocess.PIPE)
        found = wait_until(lambda: json.loads(run_gimnet(hub, "--json", "services").out), "the service")
        self.assertEqual([(s["name"], s["delivery"], s["direction"], s["subscribers"]) for s in found],
                         [("robot/scan", "latest", "provides", 0)])
        robot = hub.wait_for_node("robot")
        self.assertEqual((robot["id"], robot["connected"], robot["services"]), (found[0]["node"], True, 1))
        self.assertTrue(robot["id"].startswith("7."))
        self.assertEqual([found[0][key] for key in ("place", "hub", "state")], [robot[key] for key in ("place", "hub", "state")])
        row = run_gimnet(hub, "services").out.decode().splitlines()[1].split()
        self.assertEqual(row[:5] + row[8:9], ["robot/scan", robot["id"], robot["hub"], "connected", robot["place"], "no"])
        echo = start_gimnet(self, hub, "echo", "robot/scan")
        wait_until(lambda: subscribers_of(hub, "robot/scan") == 1, "one subscriber")
        echo.signal(2)
        self.assertEqual(echo.wait(), 130)
        wait_until(lambda: subscribers_of(hub, "robot/scan") == 0, "no subscriber")
        pub.feed(b"")
        self.assertEqual(pub.wait(), 0)

    def test_rate(self):
        hub = Hub(self)
        echo = start_gimnet(self, hub, "echo", "robot/odom", "-n", "11", "--raw")
        begin = time.monotonic()
        pub = run_gimnet(hub, "pub", "robot/odom", "--wait", "1", "--rate", "20", data=b"x\n" * 11)
        self.assertGreaterEqual(time.monotonic() - begin, 0.5, "ten pauses of 50 ms at least")
        self.assertEqual((pub.code, echo.wait(), echo.out), (0, 0, b"x\n" * 11), pub.err)

    def test_subscriber_of_its_own_makes_the_ledger_count_copies(self):
        hub = Hub(self, shards=2)
        echoes = [start_gimnet(self, hub, "echo", "a/b", "-n", "100", "--raw", "--shard", str(i % 2)) for i in range(4)]
        pub = run_gimnet(hub, "pub", "a/b", "--wait", "4", data=b"x\n" * 100)
        self.assertEqual([pub.code, *(echo.wait() for echo in echoes)], [0] * 5)
        hub.expect_ledger(self, accepted=100, copies=300, delivered=sum(echo.out.count(b"\n") for echo in echoes))


class Measures(unittest.TestCase):
    def start_pub(self, hub, service, lines):
        pub = start_gimnet(self, hub, "pub", service, "--wait", "1", "--rate", "1000", stdin=subprocess.PIPE)
        hub.wait_for_node(service.partition("/")[0])
        return pub.feed(b"12345\n" * lines)

    def test_rate_and_bytes_of_a_service(self):
        hub = Hub(self)
        for command in ("hz", "bw"):
            with self.subTest(command=command):
                tool = start_gimnet(self, hub, command, "robot/odom", "-n", "200", "--json")
                pub = self.start_pub(hub, "robot/odom", 200)
                self.assertEqual((tool.wait(), pub.wait()), (0, 0), tool.err)
                said = [json.loads(line) for line in tool.out.splitlines()][-1]
                self.assertEqual((said["service"], said["whole"], said["messages"], said["missed"]),
                                 ("robot/odom", True, 200, 0))
                if command == "hz":
                    self.assertLessEqual(said["gap_min_ms"], said["gap_mean_ms"])
                    self.assertLessEqual(said["gap_mean_ms"], said["gap_max_ms"])
                    self.assertGreater(said["rate_hz"], 0)
                else:
                    self.assertEqual((said["bytes"], said["size_min"], said["size_max"]), (1000, 5, 5))

    def test_a_pattern_takes_in_what_comes_later(self):
        hub = Hub(self)
        hz = start_gimnet(self, hub, "hz", "robot/*", "--json")
        wait_until(lambda: "no service matches robot/* yet" in hz.err, "the words that it waits")
        pub = self.start_pub(hub, "robot/odom", 100)
        wait_until(lambda: pub.popen.poll() is not None, "all published to the one that waited")
        hz.signal(2)
        self.assertEqual(hz.wait(), 130, hz.err)
        said = [json.loads(line) for line in hz.out.splitlines()][-1]
        self.assertEqual((said["service"], said["whole"], said["missed"]), ("robot/odom", True, 0))

    def test_echo_of_a_pattern(self):
        hub = Hub(self)
        pubs = [self.start_pub(hub, service, 10) for service in ("robot/odom", "robot2/odom", "robot/scan2")[:2]]
        echo = start_gimnet(self, hub, "echo", "*/odom", "-n", "20", "--json")
        self.assertEqual([echo.wait(), *(pub.wait() for pub in pubs)], [0, 0, 0], echo.err)
        counts = {}
        for line in echo.out.splitlines():
            service = json.loads(line)["service"]
            counts[service] = counts.get(service, 0) + 1
        self.assertEqual(counts, {"robot/odom": 10, "robot2/odom": 10})

    def test_nothing_came_in_time(self):
        hub = Hub(self)
        for words in (["echo", "a/b"], ["hz", "a/b"], ["bw", "**"], ["recv", "--name", "B"]):
            tool = run_gimnet(hub, *words, "--seconds", "0.2")
            self.assertEqual(tool.code, 5, tool.err)
            self.assertIn("waited 0.2 s for a message", tool.err)


class Lists(unittest.TestCase):
    def test_what_matches_nothing_is_not_found(self):
        hub = Hub(self)
        start_recv(self, hub, "robot")
        tool = run_gimnet(hub, "nodes", "robto", "--json")
        self.assertEqual((tool.code, json.loads(tool.out)), (4, []))
        self.assertIn("did you mean robot?", tool.err)
        self.assertEqual(run_gimnet(hub, "services", "robot/*").code, 4)
        robot = hub.wait_for_node("robot")["id"]
        self.assertEqual([node["name"] for node in json.loads(run_gimnet(hub, "nodes", robot, "--json").out)], ["robot"])
        self.assertEqual(run_gimnet(hub, "services").code, 0)

    def test_looks_of_the_tool_are_listed_only_when_asked_for(self):
        hub = Hub(self)
        Client(self, hub).join()
        self.assertEqual([node["description"] for node in json.loads(run_gimnet(hub, "nodes", "--json").out)], [""])
        everybody = json.loads(run_gimnet(hub, "nodes", "--all", "--json").out)
        self.assertIn("gimnet tool", [node["description"] for node in everybody])


class Watches(unittest.TestCase):
    def events(self, watch):
        return [(event["change"], event.get("node", event.get("service", {})).get("name"))
                for event in map(json.loads, watch.out.splitlines())]

    def test_who_comes_and_goes(self):
        hub = Hub(self)
        start_recv(self, hub, "early")
        watch = start_gimnet(self, hub, "watch", "**", "--json")
        wait_until(lambda: ("snapshot_ends", None) in self.events(watch), "what is there already")
        pub = start_gimnet(self, hub, "pub", "robot/odom", stdin=subprocess.PIPE)
        wait_until(lambda: ("advertised", "robot/odom") in self.events(watch), "the new service")
        pub.feed(b"")
        self.assertEqual(pub.wait(), 0)
        wait_until(lambda: ("left", "robot") in self.events(watch), "the end of the node")
        watch.signal(2)
        self.assertEqual(watch.wait(), 130, watch.err)
        seen = self.events(watch)
        self.assertEqual(seen[:3], [("snapshot_begins", None), ("present", "early"), ("snapshot_ends", None)])
        wanted = [("joined", "robot"), ("advertised", "robot/odom"), ("withdrawn", "robot/odom"), ("left", "robot")]
        self.assertEqual([event for event in seen if event in wanted], wanted)

    def test_waiting_for_a_node(self):
        hub = Hub(self)
        nobody = run_gimnet(hub, "watch", "robot", "-n", "1", "--seconds", "0.1")
        self.assertEqual(nobody.code, 5)
        self.assertIn("waited 0.1 s for an event of robot: none came", nobody.err)
        waiting = start_gimnet(self, hub, "watch", "robot", "-n", "1")
        start_recv(self, hub, "robot")
        self.assertEqual(waiting.wait(), 0, waiting.err)
        self.assertIn(b"node robot 7.", waiting.out)
        again = run_gimnet(hub, "watch", "robot", "-n", "1")
        self.assertEqual(again.code, 0)
        self.assertIn(b"  present      node robot 7.", again.out)

    def test_a_watch_that_the_hub_refuses_names_its_pattern_if_it_has_one(self):
        hub = Hub(self, "--limit", "watches=0")
        for words, said in ((["watch"], "gimnet: cannot watch: "), (["watch", "a/*"], "gimnet: cannot watch 'a/*': ")):
            watch = run_gimnet(hub, *words)
            self.assertEqual(watch.code, 1, watch.err)
            self.assertIn(said, watch.err)

    def test_its_own_looks_are_left_out_unless_asked_for(self):
        hub = Hub(self)
        quiet = start_gimnet(self, hub, "watch", "--json")
        everybody = start_gimnet(self, hub, "watch", "--all", "--json")
        wait_until(lambda: b"gimnet tool" in everybody.out, "at least its own")
        Client(self, hub).join("robot")
        for watch in (quiet, everybody):
            wait_until(lambda watch=watch: b'"robot"' in watch.out, "who came after it")
        self.assertNotIn(b"gimnet tool", quiet.out)


class Names(unittest.TestCase):
    def test_a_name_is_held_once(self):
        hub = Hub(self)
        start_recv(self, hub, "B")
        second = run_gimnet(hub, "recv", "--name", "B")
        self.assertEqual(second.code, 6)
        self.assertIn("'B' is held by node 7.", second.err)

    def test_raw_resolve_and_subscribe(self):
        hub = Hub(self)
        client = Client(self, hub).join("raw/client")
        self.assertEqual(client.ask(NS, 3, text(3, "raw/client"))[3], client.id)
        self.assertEqual(client.ask(NS, 3, text(3, "nobody"))[1], 3)
        answer = client.ask(NS, 7, text(3, "odom") + number(4, 4, 1) + number(5, 4, 2))
        self.assertNotIn(answer.get(1), (1, 2, 3, 4, 5, 6))
        other = Client(self, hub).join()
        self.assertEqual(other.ask(NS, 10, text(3, "raw/client/odom"))[4], answer[3])
        told = client.next_where(lambda got: got.kind == NS and got.operation == 33)
        self.assertEqual((told.fields[3], told.fields[4]), (answer[3], 1), "subscribers now")


if __name__ == "__main__":
    unittest.main()
