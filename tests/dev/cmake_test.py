#!/usr/bin/env python3
"""How the project configures: missing programs are told at once, and it can be a part of another project.

Usage: cmake_test.py CMAKE"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TIMEOUT_S = 300
# What CMake finds beside the folders of PATH.
NO_SYSTEM_PROGRAMS = ("-DCMAKE_FIND_USE_CMAKE_SYSTEM_PATH=OFF", "-DCMAKE_FIND_USE_INSTALL_PREFIX=OFF")
TOOLCHAIN = f"""cmake_minimum_required(VERSION 3.22)
project(outside LANGUAGES NONE)
include({ROOT}/cmake/GimnetToolchain.cmake)
"""
OUTSIDE = f"""cmake_minimum_required(VERSION 3.22)
project(outside LANGUAGES C CXX)
add_subdirectory({ROOT} gimnet)
add_executable(pose {ROOT}/examples/pose.c)
target_link_libraries(pose PRIVATE gimnet::bitestream_static)
add_library(publisher OBJECT {ROOT}/examples/publisher.cpp)
target_link_libraries(publisher PRIVATE gimnet::gimi)
"""


class Configuring(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.programs = self.folder / "programs"
        self.programs.mkdir()

    def cmake(self, *arguments, **environment):
        return subprocess.run([CMAKE, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              timeout=TIMEOUT_S, env=environment or None, check=False)

    def configure(self, project, *arguments, **environment):
        (self.folder / "CMakeLists.txt").write_text(project)
        return self.cmake("-S", self.folder, "-B", self.folder / "build", "-G", "Ninja", *arguments, **environment)

    def test_tells_which_program_of_an_option_is_missing(self):
        for option, program, package in (("GIMNET_CCACHE", "ccache", "ccache"), ("GIMNET_LLD", "ld.lld", "lld")):
            how = (f"-DCMAKE_MAKE_PROGRAM={shutil.which('ninja')}", *NO_SYSTEM_PROGRAMS)
            environment = {"PATH": str(self.programs), option: "1"}
            with self.subTest(option):
                shutil.rmtree(self.folder / "build", ignore_errors=True)  # it remembers the options
                missing = self.configure(TOOLCHAIN, *how, **environment)
                self.assertNotEqual(missing.returncode, 0)
                words = " ".join(missing.stderr.split())
                self.assertIn(f"{option} is on, and {program} is not installed: install it with `apt-get install {package}`",
                              words)
                (self.programs / program).write_text("#!/bin/sh\n")
                (self.programs / program).chmod(0o755)
                there = self.configure(TOOLCHAIN, *how, **environment)
                self.assertEqual(there.returncode, 0, there.stderr)

    def test_is_a_part_of_another_project(self):
        made = self.configure(OUTSIDE, "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON",
                              "-DGIMNET_WARNINGS_AS_ERRORS=ON")
        self.assertEqual(made.returncode, 0, made.stderr)
        commands = {entry["file"]: entry["command"]
                    for entry in json.loads((self.folder / "build" / "compile_commands.json").read_text())}
        for example in ("pose.c", "publisher.cpp"):
            command = commands[f"{ROOT}/examples/{example}"]
            self.assertNotRegex(command, r" -W|/src\b", "options and folders of the project are its own")
        built = self.cmake("--build", self.folder / "build", "--target", "pose", "publisher")
        self.assertEqual(built.returncode, 0, built.stdout + built.stderr)
        pose = subprocess.run([self.folder / "build" / "pose"], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              timeout=TIMEOUT_S, check=False)
        self.assertEqual(pose.returncode, 0, pose.stderr)


class WholeProject(unittest.TestCase):
    """What a plain cmake makes of it, where ccache and lld are installed and nobody asked for them."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        programs = cls.folder / "programs"
        programs.mkdir()
        for program, script in (("ccache", 'exec "$@"'), ("ld.lld", 'exec ld "$@"')):
            (programs / program).write_text(f"#!/bin/sh\n{script}\n")
            (programs / program).chmod(0o755)
        cls.environment = {name: value for name, value in os.environ.items()
                           if not name.startswith("GIMNET_") and name not in ("CFLAGS", "CXXFLAGS", "LDFLAGS")}
        cls.environment["PATH"] = f"{programs}:{cls.environment['PATH']}"
        cls.plain = cls.configure("plain")

    @classmethod
    def configure(cls, name, *arguments, **environment):
        build = cls.folder / name
        subprocess.run([CMAKE, "-S", ROOT, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", *arguments],
                       stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, timeout=TIMEOUT_S,
                       env=cls.environment | environment, check=True)
        return build

    @staticmethod
    def options(build):
        """Which of the three it builds with: warnings as errors, ccache, lld."""
        ninja = "".join((build / name).read_text() for name in ("build.ninja", "CMakeFiles/rules.ninja"))
        words = {"-Werror": r" -Werror", "ccache": r"\bccache ", "lld": r" -fuse-ld=lld"}
        return {name: bool(re.search(word, ninja)) for name, word in words.items()}

    def test_takes_no_warning_for_an_error_and_no_ccache_or_lld_unasked(self):
        self.assertEqual(self.options(self.plain), {"-Werror": False, "ccache": False, "lld": False})

    def test_takes_what_it_is_asked_for(self):
        less = [f"-DGIMNET_{part}=OFF" for part in ("TESTS", "BENCH", "PERF", "EXAMPLES")]
        asked = self.configure("asked", "-DGIMNET_WARNINGS_AS_ERRORS=ON", *less, GIMNET_CCACHE="1", GIMNET_LLD="1")
        self.assertEqual(self.options(asked), {"-Werror": True, "ccache": True, "lld": True})

    def inputs(self, target):
        """All that is made or read for the target."""
        ninja = subprocess.run(["ninja", "-C", self.plain, "-t", "inputs", target], stdin=subprocess.DEVNULL, capture_output=True,
                               text=True, timeout=TIMEOUT_S, check=True)
        return [line.removeprefix(f"{ROOT}/") for line in ninja.stdout.splitlines()]

    def test_the_product_is_programs_libraries_and_examples_alone(self):
        inputs = self.inputs("product")
        for part in ("src/hub/main.cpp", "src/tools/gimnet/main.cpp", "src/tools/demo/main.cpp", "src/client/gimnet.map",
                     "examples/publisher.cpp"):
            self.assertIn(part, inputs)
        folders = {line.split("/")[0] for line in inputs if re.match(r"[^/].*\.(c|cpp|o)$", line)}
        self.assertEqual(folders, {"src", "examples"}, "compiles nothing else")
        self.assertIn("tests", {line.split("/")[0] for line in self.inputs("all_unit")})


if __name__ == "__main__":
    CMAKE = sys.argv.pop(1)
    unittest.main()
