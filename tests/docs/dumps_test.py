#!/usr/bin/env python3
"""docs/protocol.md and docs/bitestream.md show every vector as it is, and what is said beside the bytes is what they say."""

import pathlib
import re
import struct
import sys
import unittest

import dumps

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system"))
from stranger_parts import bitestream  # noqa: E402  (reads Bitestream as the document says, apart from the library)

PAGE = dumps.PROTOCOL.read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (\d+)\.[^\n]*\n(.*?)(?=^## |\Z)", PAGE, re.S | re.M))
KINDS = dict(re.findall(r"^\| (\d+) \| ([A-Z]+) \|", SECTIONS["2"].split("| flags | name |")[0], re.M))
SHOWN = [each for folder in dumps.FAMILIES for each in dumps.vectors(folder)]
FRAMES = [each for each in SHOWN if len(each.data) >= dumps.HEADER]
TYPES = {name: code for code, name in enumerate(
    "opaque bool u8 u16 u32 u64 i8 i16 i32 i64 f32 f64 text time nested".split())}
NUMBERS = {code for name, code in TYPES.items() if name[1:].isdigit() or name == "time"}
ARRAYS = {f"array of {name}": code + 16 for name, code in TYPES.items() if name not in ("opaque", "text", "nested")}
LANES = ("0 real-time", "1 normal", "2 bulk", "3 background")
KEY = re.compile(r'^\s*key (?:(\d+)|"(.*?)") (array of \w+|\w+)(?:: (.*))?$')


def named(section, pattern):
    return re.findall(pattern, SECTIONS[section], re.M)


def operation(frame):
    return struct.unpack_from("<H", frame.data, dumps.HEADER)[0]


def said_of_node(number):
    return {f"{number >> 20}.{number & 0xFFFFF}", f"{number >> 20}#{number & 0xFFFFF}",
            f"{number >> 20}." + {0: "hub", 0xFFFFF: "every"}.get(number & 0xFFFFF, "?")}


class Dumps(unittest.TestCase):
    def test_the_documents_show_the_vectors(self):
        anew = "run tests/docs/dumps.py, which writes it anew"
        self.assertEqual(PAGE[PAGE.index(dumps.SECTION):], dumps.section_of_protocol(), anew)
        page = dumps.BITESTREAM.read_text(encoding="utf-8")
        self.assertEqual(page[page.index("Examples:\n"):], dumps.section_of_bitestream(), anew)

    def test_every_dump_of_a_document_is_that_of_the_vectors_it_names(self):
        count = 0
        for document in (dumps.PROTOCOL, dumps.BITESTREAM):
            for names, data in dumps.dumps(document.read_text(encoding="utf-8")):
                count += 1
                self.assertTrue(names, f"{document.name}: a dump without the name of its vector: {data[:24].hex(' ')}")
                self.assertEqual(data, b"".join(dumps.vector(name).data for name in names), names)
        self.assertEqual(count, len(SHOWN) + len(dumps.OF_BITESTREAM) + 1, "section 2 has one more")

    def test_every_frame_kind_has_a_dump(self):
        kinds = set(map(int, KINDS))
        self.assertGreaterEqual(len(kinds), 12, "the table was not understood")
        self.assertEqual(kinds - {frame.data[12] for frame in FRAMES}, set())

    def test_every_operation_has_a_dump(self):
        flow = {frame.data[dumps.HEADER] for frame in FRAMES if frame.data[12] == dumps.FLOW}
        self.assertEqual(flow, {int(code) for code, _ in named("4", r"^\| (\d+) \| ([A-Z]+) \|")})
        gimi = {frame.data[dumps.HEADER + 16] for frame in FRAMES if frame.name.startswith("gimi/")}
        self.assertEqual(gimi, {int(code) for code, _ in named("7", r"^\| (\d) \| ([A-Z]+) \|")})
        link = {operation(frame) for frame in FRAMES if frame.data[12] == dumps.LINK}
        self.assertEqual(link, {int(code) for code in named("3", r"^[A-Z]+ \(operation (\d)\)")})
        route = {operation(frame) for frame in FRAMES if frame.data[12] == dumps.ROUTE}
        self.assertEqual(route, {int(code) for code, _ in named("10", r"^\| (\d+) \| ([A-Z_]{4,}) \|")})
        for kind, section in ((dumps.NS, "8"), (dumps.CTRL, "9")):
            seen = {operation(frame) for frame in FRAMES if frame.data[12] == kind}
            requests = {int(code) for code in named(section, r"^\| (\d+) \| [A-Z_]{4,} \|[^|]*\|[^|]*\|$")}
            events = {int(code) for code in named(section, r"^\| (\d+) \| [A-Z_]{4,} \| [^|]*\|$")}
            self.assertGreaterEqual(len(requests), 9, "the table was not understood")
            self.assertEqual(seen, requests | {code | 0x8000 for code in requests} | events)

    def test_every_type_of_bitestream_has_a_dump(self):
        seen = {kind for _, kind, _ in bitestream.take(dumps.vector("bitestream/every_type").data)}
        self.assertEqual(seen, set(TYPES.values()) | set(ARRAYS.values()))

    def test_what_is_said_of_the_header_is_true(self):
        kinds = KINDS | {"8": "(not known)"}
        for frame in FRAMES:
            with self.subTest(frame.name):
                length, dst, src, kind, flags, hops, lane = struct.unpack_from("<IIIBBBB", frame.data)
                said = [line.meaning for line in frame.lines[:4]]
                self.assertEqual(said[0], f"length {length}")
                self.assertEqual(length, len(frame.data) - dumps.HEADER)
                if dst >> 20:
                    self.assertIn(said[1].removeprefix("dst "), said_of_node(dst))
                else:
                    self.assertRegex(said[1], rf"^dst {dst}(:|$)")
                self.assertIn(said[2].removeprefix("src "), said_of_node(src) if src else {"0"})
                self.assertRegex(said[3], rf"^kind {kind} {re.escape(kinds[str(kind)])}, flags {flags:02x}\b"
                                 if flags else rf"^kind {kind} {re.escape(kinds[str(kind)])}, flags 0,")
                self.assertTrue(said[3].endswith(f", hops {hops}, lane {LANES[lane]}"), said[3])

    def test_what_is_said_of_an_operation_is_true(self):
        names = {dumps.FLOW: dict(named("4", r"^\| (\d+) \| ([A-Z]+) \|")),
                 dumps.LINK: {code: name for name, code in named("3", r"^([A-Z]+) \(operation (\d)\)")},
                 dumps.NS: dict(named("8", r"^\| (\d+) \| ([A-Z_]{4,}) \|")),
                 dumps.CTRL: dict(named("9", r"^\| (\d+) \| ([A-Z_]{4,}) \|")),
                 dumps.ROUTE: dict(named("10", r"^\| (\d+) \| ([A-Z_]{4,}) \|"))}
        for frame in FRAMES:
            kind = frame.data[12]
            if kind not in names:
                continue
            with self.subTest(frame.name):
                said = frame.lines[4].meaning
                if kind == dumps.FLOW:
                    code = frame.data[dumps.HEADER]
                    self.assertRegex(said, rf"^operation {code} {names[kind][str(code)]}\b")
                    continue
                code, request = struct.unpack_from("<HH", frame.data, dumps.HEADER)
                name = "answer" if code & 0x8000 else names[kind][str(code)]
                self.assertEqual(said, f"operation {code:#x} {name}, request {request}")

    def test_what_is_said_of_a_value_is_true(self):
        every = SHOWN + [dumps.vector(f"bitestream/{name}") for name in dumps.OF_BITESTREAM]
        count = sum(self.check_value(each, line) for each in every for line in each.lines if KEY.match(line.meaning))
        self.assertGreater(count, 250)

    def check_value(self, vector, line):
        number, name, kind, said = KEY.match(line.meaning).groups()
        with self.subTest(vector.name, said=line.meaning):
            code = TYPES[kind] if kind in TYPES else ARRAYS[kind]
            head, data = line.data[0], line.data
            self.assertEqual(head >> 3, code)
            if head & 4:
                self.assertEqual(data[2:2 + data[1]].decode(), name)
            else:
                self.assertEqual(data[1:4], int(number).to_bytes(3, "little"))
            if code == TYPES["nested"]:
                return 1  # its values have lines of their own
            (_, _, value), = bitestream.take(data)
            words = set(re.split(r"[ ,]+", said))
            if code == TYPES["text"]:
                self.assertIn(f'"{value}"', said)
            elif code == TYPES["bool"]:
                self.assertIn(str(value).lower(), words)
            elif code in NUMBERS:
                self.assertTrue(({str(value)} | (said_of_node(value) if isinstance(value, int) else set())) & words)
            elif isinstance(value, list):
                self.assertEqual(", ".join(str(each).lower() for each in value), said)
        return 1


if __name__ == "__main__":
    unittest.main()
