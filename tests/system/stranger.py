#!/usr/bin/env python3
"""Can a client be written from docs/protocol.md and docs/bitestream.md alone? This one was. It does every operation
that they describe, and the last test compares what it did and saw with their tables."""

import pathlib
import re
import time
import unittest

from stranger_parts import client as wire
from stranger_parts.bitestream import F64, NESTED, OPAQUE, TEXT, U32, U8, Broken, put, take
from stranger_parts.case import Case
from stranger_parts.client import CTRL, NS, UNICAST, Refused
from stranger_parts.control_cases import Administration, Names
from stranger_parts.data_cases import Data, Flow, Gimi
from stranger_parts.drop_cases import Drops
from stranger_parts.ending_cases import Endings
from stranger_parts.link_cases import Links

__all__ = ["Administration", "Data", "Drops", "Endings", "Flow", "Gimi", "Links", "Names"]
DOCS = pathlib.Path(__file__).resolve().parents[2] / "docs"


class Bitestream(unittest.TestCase):
    def test_the_examples_of_the_document(self):
        page = (DOCS / "bitestream.md").read_text()
        self.assertIn("60 03 00 00 05 72 6f 62 6f 74", page)
        self.assertEqual(put(3, TEXT, "robot").hex(" "), "60 03 00 00 05 72 6f 62 6f 74")
        self.assertEqual(put("v", F64, 0.5).hex(" "), "5c 01 76 08 00 00 00 00 00 00 e0 3f")

    def test_every_type_is_read_back(self):
        contents = {0: b"\xff\0", 1: True, 2: 255, 3: 65535, 4: 2**32 - 1, 5: 2**64 - 1, 6: -128, 7: -2**15, 8: -2**31,
                    9: -2**63, 10: 0.5, 11: 0.1, 12: "Größe", 13: 17, 17: [True, False], 18: [1, 2], 19: [3], 20: [4],
                    21: [5], 22: [-1], 23: [-2], 24: [-3], 25: [-4], 26: [0.25], 27: [0.1], 29: [6, 7]}
        stream = b"".join(put(kind, kind, content) for kind, content in contents.items())
        self.assertEqual({key: content for key, _, content in take(stream)}, contents)
        self.assertEqual(take(put(1, NESTED, put("inner", U8, 3))), [(1, NESTED, [("inner", U8, 3)])])
        for size in (255, 256, 65535, 65536):
            self.assertEqual(take(put(9, OPAQUE, bytes(size)))[0][2], bytes(size))

    def test_what_is_forbidden_is_refused(self):
        deep = put(1, U8, 1)
        for _ in range(17):
            deep = put(1, NESTED, deep)
        for stream in (b"\x03\0\0\0\0", put(1, U32, 5)[:-1], b"\x10\1\0\0\2\0\0", b"\x78\1\0\0\1\0", deep):
            with self.assertRaises(Broken):
                take(stream)
        with self.assertRaises(Broken):
            put(1, TEXT, "")


class Connection(Case):
    def test_welcome_tells_all_that_the_document_says(self):
        hub = self.hub(hub_id=9)
        made = self.stranger(hub, "robot1/base", description="a stranger")
        self.assertEqual((made.id >> 20, made.welcome[3], made.welcome[18]), (9, 9, "robot1/base"))
        self.assertTrue({1, 2, 3, 4, 5, 6, 8, 9, 10, 14} <= set(made.welcome), made.welcome)
        self.assertEqual(made.welcome[6], 65536)
        self.assertLess(abs(made.ping() - time.time_ns()), 60e9)

    def test_a_token_brings_id_and_name_back_and_the_older_connection_is_told(self):
        hub = self.hub()
        first = self.stranger(hub, "robot")
        second = self.stranger(hub, token=first.welcome[2])
        self.assertEqual((second.id, second.welcome[18]), (first.id, "robot"))
        with self.assertRaises(Refused) as refused:
            first.wait(lambda got: False)
        self.assertEqual(refused.exception.args[0], 8)

    def test_a_live_name_is_refused_with_its_holder(self):
        hub = self.hub()
        self.stranger(hub, "robot")
        with self.assertRaises(Refused) as refused:
            self.stranger(hub, "robot")
        self.assertEqual(refused.exception.args[0], 4)
        self.assertIn("7.1", refused.exception.args[1])

    def test_refusals_of_the_table(self):
        hub = self.hub("--limit", "nodes=2")
        for name, code in (("a//b", 5), ("ä", 5), ("a/*", 5)):
            with self.assertRaises(Refused) as refused:
                self.stranger(hub, name)
            self.assertEqual(refused.exception.args[0], code)
        self.stranger(hub, "one")
        spoofing = self.stranger(hub, "two")
        with self.assertRaises(Refused) as refused:
            self.stranger(hub)
        self.assertEqual(refused.exception.args[0], 6)
        spoofing.write(UNICAST, spoofing.id, b"x", src=spoofing.id + 1)
        with self.assertRaises(Refused) as refused:
            spoofing.wait(lambda got: False)
        self.assertEqual(refused.exception.args[0], 11)

    def test_goodbye_frees_the_name_at_once(self):
        hub = self.hub()
        self.stranger(hub, "robot").leave()
        self.assertEqual(self.stranger(hub, "robot").welcome[18], "robot")


class ZDocument(unittest.TestCase):
    """Runs last: unittest sorts by name."""

    # What strangers at one hub cannot make happen, since it takes other hubs, or threads and memory that are used up
    # at the right moment: other tests do.
    ELSEWHERE = {("GOODBYE", 16), ("reason", 7), ("reason", 10), ("reason", 12), ("reason", 22), (NS, 14), (NS, 36)}

    def test_the_stranger_did_all_that_the_tables_name(self):
        if ("LINK", 2) not in wire.seen:
            self.skipTest("looks at what the other tests of this file did")
        page = (DOCS / "protocol.md").read_text()
        sections = dict(re.findall(r"^## (\d+)\.[^\n]*\n(.*?)(?=^## |\Z)", page, re.S | re.M))
        named = set()
        for row in re.findall(r"^\| (\d+) \| ([A-Z]+) \|", sections["2"], re.M):
            if row[1] not in ("ROUTE", "PAD", "TRACE", "AGE"):
                named.add(("kind", int(row[0])))
        named |= {("LINK", code) for code in (1, 2, 3)}
        named |= {("FLOW", int(code)) for code in re.findall(r"^\| (\d+) \| [A-Z]+ \|", sections["4"], re.M)}
        named |= {("GOODBYE", int(code)) for code, name in re.findall(r"^\| (\d+) \| ([a-z_]+) \|", sections["3"], re.M)
                  if name not in ("bool", "opaque", "text", "time")}
        named |= {("reason", int(code)) for code in re.findall(r"^\| (\d+) \| [a-z_0-9]+ \|", sections["5"], re.M)}
        named |= {("status", int(code)) for code in re.findall(r"^\| (\d+) \| [a-z_]+ \|$", sections["8"], re.M)}
        named |= {(NS, int(code)) for code in re.findall(r"^\| (\d+) \| [A-Z_]+ \|", sections["8"], re.M)}
        named |= {(CTRL, int(code)) for code in re.findall(r"^\| (\d+) \| [A-Z_]+ \|", sections["9"], re.M)}
        self.assertGreater(len(named), 60, "the tables of the document were not understood")
        self.assertEqual(named - wire.seen - self.ELSEWHERE, set(), "in the document, but never done")
        self.assertEqual(self.ELSEWHERE & wire.seen, set(), "done here after all")
        self.assertLessEqual(self.ELSEWHERE, named, "no longer in the document")


if __name__ == "__main__":
    unittest.main()
