#!/usr/bin/env python3
"""libgimnet.so offers exactly the functions of the public headers, and their structs and constants are those that are kept in
layout.txt and src/client/gimnet.map. docs/compatibility.md says what is promised.

    abi_test.py LIBRARY C_COMPILER
    abi_test.py --update C_COMPILER      writes layout.txt anew"""

import pathlib
import re
import subprocess
import sys
import unittest

import public_headers

LAYOUT = pathlib.Path(__file__).with_name("layout.txt")
MAP = public_headers.ROOT / "src" / "client" / "gimnet.map"
# Whatever else the library needed, every program that links it would need.
NEEDED = {"libstdc++.so.6", "libgcc_s.so.1", "libm.so.6", "libc.so.6", "ld-linux-x86-64.so.2"}
TIMEOUT_S = 60


def readelf(*arguments):
    return subprocess.run(["readelf", "--wide", *arguments, LIBRARY], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
                          timeout=TIMEOUT_S, check=True).stdout.splitlines()


def promised():
    """The version of each function, as gimnet.map says."""
    found, version = {}, None
    for line in MAP.read_text().splitlines():
        if node := re.match(r"(\w[\w.]*) \{", line):
            version = node[1]
        elif symbol := re.fullmatch(r"    (\w+);", line):
            found[symbol[1]] = version
    return found


class Symbols(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.offered, cls.binds = {}, set()
        for line in readelf("--dyn-syms"):
            words = line.split()
            if not re.match(r" +\d+: ", line) or " UND" in line or " ABS " in line:
                continue
            cls.binds.add(words[4])
            name, _, version = words[7].partition("@@")
            cls.offered[name] = version

    def test_are_the_functions_of_the_headers_with_the_versions_of_the_map(self):
        self.assertEqual(sorted(self.offered), public_headers.functions(), "a function is new: add it to src/client/gimnet.map")
        self.assertEqual(self.offered, promised())

    def test_none_is_unique_in_the_process(self):
        self.assertEqual(self.binds, {"GLOBAL"})

    def test_the_library_stays_where_it_was_loaded_and_needs_the_system_alone(self):
        dynamic = "\n".join(readelf("--dynamic"))
        self.assertIn("[libgimnet.so.1]", dynamic)
        self.assertRegex(dynamic, r"FLAGS_1.*NODELETE")
        needed = set(re.findall(r"NEEDED.*\[(.*)\]", dynamic))
        self.assertLessEqual(needed, NEEDED)


class Layout(unittest.TestCase):
    maxDiff = None

    def test_structs_and_constants_are_those_that_are_kept(self):
        kept = LAYOUT.read_text().splitlines()
        self.assertGreater(len(kept), 300)
        self.assertEqual(public_headers.layout(COMPILER), kept)


if __name__ == "__main__":
    COMPILER = sys.argv.pop()
    if sys.argv[1:] == ["--update"]:
        LAYOUT.write_text("\n".join([*public_headers.layout(COMPILER), ""]))
    else:
        LIBRARY = sys.argv.pop()
        unittest.main()
