#!/usr/bin/env python3
"""Dictionaries as Bitestreams: the vectors of the protocol, what cannot be said, and hostile bytes."""

import enum
import math
import pathlib
import random
import unittest

from gimnet import BitestreamError, Time
from gimnet.bitestream import decode, encode

VECTORS = pathlib.Path(__file__).resolve().parents[1] / "vectors" / "bitestream"


def vector(name):
    lines = (VECTORS / f"{name}.hex").read_text(encoding="utf-8").splitlines()
    return bytes.fromhex("".join(line.split("#")[0] for line in lines))


class NumpyScalar:
    """Looks as a number of numpy does, which need not be installed."""

    shape = ()

    def __init__(self, value):
        self._value = value

    def item(self):
        return self._value


class Bitestream(unittest.TestCase):
    def test_reads_and_writes_the_example(self):
        values = {3: "robot", "v": 0.5}
        self.assertEqual(decode(vector("example")), values)
        self.assertEqual(encode(values), vector("example"))

    def test_reads_every_type(self):
        values = decode(vector("every_type"))
        self.assertEqual([values[key] for key in (1, 2, 3, 6, 7, 10, 11, 13)],
                         [b"\x00\xff", True, 200, 2 ** 64 - 1, -100, -2 ** 63, 1.5, "ä€"])
        self.assertIs(type(values[14]), Time)
        self.assertEqual([values[key] for key in (15, 16, 21, 25, 27)],
                         [{1: 1}, [True, False], [-1, 2], [0.5, -2.0], [Time(0), Time(1)]])
        self.assertEqual(len(values), 27)

    def test_takes_any_length_field_and_the_first_of_a_repeated_key(self):
        self.assertEqual(decode(vector("length_fields")), {1: 7})
        self.assertEqual(decode(vector("length_fields").replace(b"\x00\x07", b"\x00\x08")), {1: 7})
        self.assertEqual(encode(decode(vector("long_text"))), vector("long_text"))

    def test_what_is_written_is_read(self):
        for value in (True, 0, -1, 2 ** 63 - 1, -2 ** 63, 2 ** 63, 2 ** 64 - 1, 0.1, math.inf, "ä", "x" * 70000, b"\0" * 256,
                      Time(5), {"a": {"b": 1}}, [True, False], [1, -2], [2 ** 63, 1], [0.5, -2.0], [Time(1)]):
            with self.subTest(str(value)[:40]):
                got = decode(encode({"key": value, 16777215: value}))
                self.assertEqual(got, {"key": value, 16777215: value})
                self.assertIs(type(got["key"]), type(value))
        self.assertEqual(decode(encode({"a": [1, 0.5], "b": (1, 2), "c": bytearray(b"x")})), {"a": [1.0, 0.5], "b": [1, 2], "c": b"x"})
        self.assertTrue(math.isnan(decode(encode({"a": math.nan}))["a"]))

    def test_takes_enums_and_numbers_of_numpy(self):
        gear = enum.IntEnum("gear", "first second")
        for value, meant in ((gear.second, 2), ([gear.first, gear.second, 5], [1, 2, 5]), ([NumpyScalar(0.5), 1], [0.5, 1.0]),
                             (NumpyScalar(0.5), 0.5), (NumpyScalar(7), 7), ([NumpyScalar(True), False], [True, False])):
            with self.subTest(str(value)):
                self.assertEqual(encode({"key": value}), encode({"key": meant}))
        with self.assertRaisesRegex(BitestreamError, "is a NumpyScalar"):
            encode({"key": NumpyScalar(1j)})
        with self.assertRaisesRegex(BitestreamError, "list of bool, int"):
            encode({"key": [gear.first, True]})

    def test_nests_16_deep_and_no_deeper(self):
        self.assertEqual(encode(decode(vector("nested_16_deep")))[:4], vector("nested_16_deep")[:4])
        with self.assertRaises(BitestreamError):
            decode(vector("nested_17_deep"))
        deep = {1: 1}
        for _ in range(16):
            deep = {1: deep}
        encode(deep)
        with self.assertRaisesRegex(BitestreamError, "16 deep"):
            encode({1: deep})

    def test_names_the_key_of_what_cannot_be_said(self):
        for value, words in ((None, "NoneType"), ("", "empty"), ([], "empty"), ({}, "empty"), (b"", "empty"), (["a"], "list of str"),
                             ([1, "a"], "list of int, str"), ([True, 1], "list of bool, int"), (2 ** 64, "whole numbers"),
                             (-2 ** 63 - 1, "whole numbers"), ([-1, 2 ** 63], "no type"), ([2 ** 53 + 1, 0.5], "list of"),
                             ("\ud800", "not Unicode"), ({1: None}, r"\[1\]"), (object(), "object"), ({-1: 1}, "key"), ({"": 1}, "key"),
                             ({"x" * 256: 1}, "key"), ({2 ** 24: 1}, "key"), ({True: 1}, "key"), ({1.5: 1}, "key")):
            with self.subTest(str(value)[:40]), self.assertRaisesRegex(BitestreamError, rf"^\['speed'\].*{words}"):
                encode({"speed": value})

    def test_hostile_bytes_are_refused_and_nothing_else_happens(self):
        good = vector("every_type")
        dice = random.Random(1)
        refused = 0
        for cut in range(1, len(good)):
            try:
                decode(good[:cut])
            except BitestreamError:
                refused += 1
        self.assertGreater(refused, len(good) * 3 // 4)
        for _ in range(3000):
            bad = bytearray(good)
            for _ in range(dice.randrange(1, 4)):
                bad[dice.randrange(len(bad))] = dice.randrange(256)
            try:
                decode(bad)
            except BitestreamError:
                refused += 1
        self.assertGreater(refused, 1000)


if __name__ == "__main__":
    unittest.main()
