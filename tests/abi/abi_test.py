#!/usr/bin/env python3
"""libgimnet.so offers exactly the functions of the public headers, and their structs and constants are those that are kept in
layout.txt and src/client/gimnet.map; and it runs the programs of kept.py, those of today and those that are kept.
docs/compatibility.md says what is promised.

    abi_test.py LIBRARY TCPHUB C_COMPILER
    abi_test.py --update C_COMPILER      writes layout.txt anew"""

import itertools
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import kept
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


class Programs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        cls.addClassCleanup(folder.cleanup)
        today = pathlib.Path(folder.name) / "today"
        today.mkdir()
        kept.compile_programs(pathlib.Path(LIBRARY).resolve().parent, today)
        cls.folders = [today, *kept.folders()]
        cls.environment = os.environ | {"LD_LIBRARY_PATH": str(pathlib.Path(LIBRARY).resolve().parent), "XDG_RUNTIME_DIR": folder.name}
        hub = subprocess.Popen([TCPHUB, "--listen", f"unix:{folder.name}/hub", "--log-level", "error", "--state-dir", f"{folder.name}/state"],
                               stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        cls.addClassCleanup(hub.communicate)
        cls.addClassCleanup(hub.kill)
        cls.hub = hub.stdout.readline().split()[1]

    def run_program(self, *words, proves=None, **environment):
        ran = subprocess.run(list(map(str, words)), stdin=subprocess.DEVNULL, capture_output=True, text=True,
                             env=self.environment | environment, timeout=TIMEOUT_S, check=False)
        expected = (0, "all is as it was\n") if proves is None else (proves, "")
        self.assertEqual((ran.returncode, ran.stdout), expected, f"{words[0]}: {ran.stderr}")

    def test_in_c_run(self):
        for folder in self.folders:
            self.run_program(folder / "program_c", self.hub)

    def test_in_cpp_run_with_plugins_of_every_version(self):
        for folder, of_plugin in itertools.product(self.folders, self.folders):
            self.run_program(folder / "program_cpp", self.hub, of_plugin / "plugin.so")

    def test_run_with_a_later_library_that_uses_the_reserved_room(self):
        later = self.folders[0] / "later.so"
        subprocess.run(["gcc", "-std=c11", "-shared", "-fPIC", f"-I{public_headers.INCLUDE}", kept.SOURCES / "later.c", "-ldl", "-o", later],
                       stdin=subprocess.DEVNULL, timeout=TIMEOUT_S, check=True)
        self.run_program(self.folders[0] / "program_c", self.hub, proves=77, LD_PRELOAD=str(later), GIMNET_TEST_PROOF="1")
        for folder in self.folders:
            self.run_program(folder / "program_c", self.hub, LD_PRELOAD=str(later))
            self.run_program(folder / "program_cpp", self.hub, folder / "plugin.so", LD_PRELOAD=str(later))


class Cpp(unittest.TestCase):
    # Of the standard library: programs say times, texts and lists with them.
    STANDARD = ("chrono", "optional", "span", "string", "string_view", "vector")

    @staticmethod
    def compile(program, *options, compiler="g++"):
        return subprocess.run([compiler, "-std=c++20", *options, f"-I{public_headers.INCLUDE}", "-x", "c++", "-"], input=program,
                              stdout=subprocess.PIPE, text=True, timeout=TIMEOUT_S, check=True).stdout

    def test_compiles_without_exceptions_and_without_rtti(self):
        program = ('#include "gimnet/gimi/executor.hpp"\n#include "gimnet/gimi.hpp"\n'
                   'int main() { return gimnet::Node::join({.name = "x"})->nodes() ? 0 : 1; }\n')
        for compiler in filter(shutil.which, ("g++", "clang++")):
            for options in ([], ["-fno-exceptions", "-fno-rtti"]):
                with self.subTest(compiler=compiler, options=options):
                    self.compile(program, "-fsyntax-only", "-Wall", "-Wextra", "-Wconversion", "-Werror", *options, compiler=compiler)

    def test_the_header_stays_small(self):
        """Behind the preprocessor: most of the time that a program takes to compile."""
        standard = self.compile("".join(f"#include <{name}>\n" for name in self.STANDARD), "-E").count("\n")
        whole = self.compile('#include "gimnet/gimi.hpp"\n', "-E").count("\n")
        self.assertLess(whole - standard, 5_000)
        if subprocess.run(["g++", "-dumpversion"], capture_output=True, text=True, timeout=TIMEOUT_S, check=True).stdout.split(".")[0] == "12":
            self.assertLess(whole, 63_000)


if __name__ == "__main__":
    COMPILER = sys.argv.pop()
    if sys.argv[1:] == ["--update"]:
        LAYOUT.write_text("\n".join([*public_headers.layout(COMPILER), ""]))
    else:
        TCPHUB = sys.argv.pop()
        LIBRARY = sys.argv.pop()
        unittest.main()
