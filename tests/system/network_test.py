#!/usr/bin/env python3
"""What `gimnet` shows of the network of hubs, at a hub that has no links."""

import json
import unittest

from support.processes import Hub, run_gimnet, start_recv
from support.wire import Client


class Alone(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self, "--limit", "silent_ms=600000")
        self.node = Client(self, self.hub).join("robot")

    def json(self, *words):
        shown = run_gimnet(self.hub, *words, "--json")
        self.assertEqual((shown.code, shown.err), (0, ""), words)
        return json.loads(shown.out)

    def test_the_hub_is_its_network(self):
        (hub,) = self.json("hubs")
        self.assertEqual((hub["id"], hub["via"], hub["distance"], hub["cost"]), (7, 7, 0, 0))
        self.assertEqual((hub["nodes"], hub["services"], hub["reachable"], hub["too_far"]), (2, 0, True, False))
        self.assertEqual(hub["name"], "hub-7")
        self.assertEqual(self.json("links"), [])
        self.assertEqual(self.json("graph"), {"hubs": [{"id": 7, "name": "hub-7", "reachable": True}], "links": []})

    def test_the_hub_can_be_named(self):
        self.assertEqual(self.json("hubs", "--hub-id", "7")[0]["id"], 7)
        self.assertEqual(self.json("status", "--hub-id", "7")["hub"]["id"], 7)
        for words in (("hubs",), ("links",), ("graph",), ("status",), ("routes", "robot")):
            other = run_gimnet(self.hub, *words, "--hub-id", "9")
            self.assertEqual(other.code, 4, (words, other.err))

    def test_the_way_to_a_node(self):
        way = [{"hub": 7, "name": "hub-7", "next_hop": 7, "distance": 0, "cost": 0}]
        self.assertEqual(self.json("routes", "robot"), way)
        self.assertEqual(self.json("routes", f"7.{self.node.id & 0xFFFFF}"), way)
        nobody = run_gimnet(self.hub, "routes", "robto")
        self.assertEqual(nobody.code, 4)
        self.assertIn("did you mean robot?", nobody.err)
        gone = run_gimnet(self.hub, "routes", "7.999")
        self.assertEqual((gone.code, gone.out), (4, b""), "as ping and trace end")
        self.assertIn("no_such_node", gone.err)
        far = run_gimnet(self.hub, "routes", "9.1")
        self.assertEqual(far.code, 4)
        self.assertIn("has no way to hub 9; `gimnet hubs` lists those that it knows", far.err)

    def test_the_status_of_all(self):
        status = self.json("status", "--all")
        self.assertTrue(status["exact"])
        (hub,) = status["hubs"]
        self.assertEqual((hub["id"], hub["name"], hub["links"]), (7, "hub-7", []))
        self.assertIn("accepted", hub["ledger"])

    def test_a_trace_has_the_hub(self):
        start_recv(self, self.hub, "B")
        trace = self.json("trace", "B", "-c", "3", "-i", "0.01")
        (hop,) = trace["hops"]
        self.assertEqual((hop["hub"], hop["clock_offset_us"], hop["clock_error_us"]), (7, 0, 0))
        self.assertTrue(0 <= hop["delay_us"]["p50"] <= hop["delay_us"]["p99"] <= trace["round_trip_us"]["p99"], trace)
        self.assertEqual((trace["sent"], trace["lost"]), (3, 0))
        silent = run_gimnet(self.hub, "trace", "robot", "-c", "1", "-W", "0.05")
        self.assertEqual(silent.code, 5, "its library does not answer")
        self.assertIn("robot answered none of 1 pings", silent.err)
        self.assertEqual(run_gimnet(self.hub, "trace", "7.999", "-c", "1").code, 4)

    def test_text_is_for_people(self):
        for words, part in ((("hubs",), "reachable"), (("links",), "LAST ERROR"), (("graph",), "7 hub-7"),
                            (("graph", "--dot"), 'graph gimnet {\n  7 [label="7 hub-7"];\n}'),
                            (("routes", "robot"), "NEXT"), (("status", "--all"), "hub 7 hub-7: ledger: ")):
            shown = run_gimnet(self.hub, *words)
            self.assertEqual(shown.code, 0, shown.err)
            self.assertIn(part, shown.out if isinstance(shown.out, str) else shown.out.decode())


if __name__ == "__main__":
    unittest.main()
