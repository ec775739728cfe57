#!/usr/bin/env python3
"""./dev on a machine that lacks every package, where what it would install, build or run only says that it was called."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
COMMANDS = ("build", "check", "test", "demo", "perf", "bench", "sim", "stress", "fuzz", "lint", "format", "asan", "tsan", "boost174", "install", "docs", "wheel")
# All that changes a machine or a tree.
PROGRAMS = ("apt-get", "sudo", "env", "sh", "cmake", "ctest", "clang-format-19", "shellcheck", "rm", "mkdir")
CALLED = '#!/bin/sh\necho "${0##*/} $*" >>"$DEV_TEST_CALLS"\n'


class Door(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.calls = self.folder / "calls"
        self.tree = self.folder / "tree"
        self.programs = self.folder / "programs"
        self.tree.mkdir()
        self.programs.mkdir()
        for entry in ROOT.iterdir():
            if entry.name != "build":
                (self.tree / entry.name).symlink_to(entry)
        for name in PROGRAMS:
            self.put_program(name, CALLED)
        self.put_program("dpkg-query", "#!/bin/sh\nexit 1\n")

    def put_program(self, name, text):
        program = self.programs / name
        program.write_text(text)
        program.chmod(0o755)

    def dev(self, *arguments):
        """The finished process, and the calls of the programs."""
        self.calls.write_text("")
        interpreter = pathlib.Path(sys.executable).parent
        environment = os.environ | {"PATH": f"{self.programs}:{interpreter}:/usr/bin:/bin", "DEV_TEST_CALLS": str(self.calls),
                                    "PYTHONDONTWRITEBYTECODE": "1"}
        process = subprocess.run([self.tree / "dev", *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                 timeout=60, env=environment, check=False)
        return process, self.calls.read_text().splitlines()

    def assert_refuses(self, *arguments, saying):
        process, calls = self.dev(*arguments)
        self.assertEqual(process.returncode, 2, process.stderr)
        self.assertIn(saying, process.stderr)
        self.assertEqual(process.stdout, "")
        self.assertEqual(calls, [])

    def test_help_installs_and_builds_nothing(self):
        for command in COMMANDS:
            for arguments in ((command, "--help"), (command, "-h"), ("help", command)):
                with self.subTest(arguments=arguments):
                    process, calls = self.dev(*arguments)
                    self.assertEqual((process.returncode, process.stderr), (0, ""))
                    self.assertRegex(process.stdout, rf"^  ([a-z]+, )?{command}\b")
                    self.assertEqual(calls, [])

    def test_help_behind_other_arguments_is_help_all_the_same(self):
        for arguments in (("perf", "--quick", "--help"), ("test", "-R", "x", "-h"), ("fuzz", "nif_receive", "--help")):
            with self.subTest(arguments=arguments):
                process, calls = self.dev(*arguments)
                self.assertEqual((process.returncode, calls), (0, []))

    def test_help_of_perf_tells_its_arguments(self):
        process, _ = self.dev("perf", "--help")
        self.assertIn("--instructions", process.stdout)
        self.assertIn("usage: ./dev perf", process.stdout)

    def test_every_command_has_a_line_of_help(self):
        process, calls = self.dev("help")
        self.assertEqual((process.returncode, calls), (0, []))
        for command in COMMANDS:
            self.assertRegex(process.stdout, rf"(?m)^  ([a-z]+, )?{command}\b")

    def test_refuses_wrong_arguments_before_it_installs_or_builds(self):
        self.assert_refuses("nonsense", saying="no command 'nonsense'")
        self.assert_refuses("build", "--fast", saying="'--fast' is not a target")
        self.assert_refuses("test", "router", saying="./dev test -R router")
        self.assert_refuses("tsan", "router", saying="./dev tsan -R router")
        self.assert_refuses("stress", "churn", saying="./dev stress -R churn")
        self.assert_refuses("bench", "--benchmark_filter=x", saying="usage: ./dev bench")
        self.assert_refuses("bench", "router", "mailbox", saying="usage: ./dev bench")
        self.assert_refuses("fuzz", "nonsense", saying="no fuzz target 'nonsense'")
        self.assert_refuses("fuzz", "nif_receive", "soon", saying="'soon' is not a number")
        for seconds in ("0", "00", "-1", "1000000000", "18446744073709551616"):
            self.assert_refuses("fuzz", "nif_receive", seconds, saying=f"'{seconds}' is not a number of seconds from 1 to 999999999")
        self.assert_refuses("fuzz", "nif_receive", "1", "2", saying="usage: ./dev fuzz")
        self.assert_refuses("lint", "src", saying="lint takes no arguments")
        self.assert_refuses("planted", "A", saying="planted takes no arguments")
        self.assert_refuses("format", "src", saying="format takes no arguments")
        self.assert_refuses("wheel", "src", saying="wheel takes no arguments")
        self.assert_refuses("docs", "src", saying="docs takes no arguments")
        self.assert_refuses("install", saying="usage: ./dev install PREFIX")
        self.assert_refuses("install", "/nowhere", "all", saying="no component 'all'")
        self.assert_refuses("boost174", "src", saying="boost174 takes no arguments")
        self.assert_refuses("perf", "--fast", saying="unrecognized arguments: --fast")
        self.assert_refuses("perf", "--hel", saying="unrecognized arguments: --hel")
        self.assert_refuses("perf", "--only", "nonsense", saying="invalid choice: 'nonsense'")

    def test_demo_refuses_what_is_none_of_its_arguments_before_it_builds(self):
        for arguments in (["--foo"], ["--seconds", "5", "foo"], ["--log=x", "view"], ["view", "--ascii", "--foo=1"], ["*"], [""]):
            with self.subTest(arguments=arguments):
                self.assert_refuses("demo", *arguments, saying=f"demo: there is no argument '{arguments[-1]}'")
        self.assert_refuses("demo", "--ascii", "--seconds", saying="demo: --seconds needs a value behind it")

    def test_demo_builds_for_all_arguments_of_its_usage(self):
        usage = re.search(r'R"\((.*?)\)"', (ROOT / "src/tools/demo/options.cpp").read_text(encoding="utf-8"), re.S)[1]
        lines = re.findall(r"^  (--.*?)  ", usage, re.M)
        self.assertGreater(len(lines), 6)
        for arguments in ([], ["robot"], ["view"], ["--log", "--foo"], ["--log=--foo"], *(line.replace(",", "").split() for line in lines)):
            if "--help" in arguments:
                continue
            with self.subTest(arguments=arguments):
                _, calls = self.dev("demo", *arguments)
                built = [call for call in calls if call.startswith("cmake --build")]
                self.assertEqual(len(built), 1, calls)
                self.assertTrue(built[0].endswith(" --target tcphub gimnet-demo"), "what it starts, and no more")

    def test_fuzz_without_a_target_lists_them(self):
        process, calls = self.dev("fuzz")
        self.assertEqual((process.returncode, calls), (2, []))
        self.assertIn("nif_receive_fuzz", process.stdout.splitlines())

    def test_perf_tells_packages_without_installing_them(self):
        process, calls = self.dev("perf", "--only", "nats", "--scenario", "library_burst", "--packages")
        self.assertEqual((process.returncode, process.stdout.split(), calls), (0, ["nats-server", "libnats-dev"], []))

    def test_gives_apt_nothing_but_names_of_packages(self):
        for words, bad in (("usage: run.py [-h]", "usage:"), ("redis-server [-h]", "[-h]"), ("redis-server --purge", "--purge"),
                           ("mosquitto-", "mosquitto-"), ("a? b", "a?"), ("~i", "~i"), ("Redis", "Redis")):
            with self.subTest(words=words):
                self.put_program("python3", f"#!/bin/sh\necho '{words}'\n")
                self.assert_refuses("perf", "--quick", saying=f"'{bad}' is not the name of a Debian package")

    def test_installs_what_is_missing(self):
        # The programs say so, too: whoever asked for nothing above would have been seen.
        process, calls = self.dev("build")
        self.assertEqual(process.returncode, 0, process.stderr)
        installs = [call for call in calls if " install " in call]
        self.assertEqual(len(installs), 1, calls)
        self.assertRegex(installs[0], r"--no-remove .*-- .*\blibjemalloc-dev\b")
        self.assertTrue([call for call in calls if call.startswith("cmake --build")], calls)

    def test_takes_any_boost_from_1_74_on(self):
        header = self.folder / "version.hpp"
        for version in (None, 107400, 199900):
            with self.subTest(version=version):
                self.put_program("find", f"#!/bin/sh\necho {header}\n" if version else "#!/bin/sh\n")
                header.write_text(f"//\n#define BOOST_VERSION {version}\n#define BOOST_LIB_VERSION \"1_74\"\n")
                process, calls = self.dev("build")
                self.assertEqual(process.returncode, 0, process.stderr)
                self.assertEqual(any(" libboost-dev" in call for call in calls), version is None, calls)
        header.write_text("#define BOOST_VERSION 107399 // 1.73\n")
        self.assert_refuses("build", saying="is 1.73, and the hub needs 1.74 or newer")

    def test_builds_the_product_alone_unless_told(self):
        _, calls = self.dev("build")
        self.assertEqual([call.split("--target ")[1] for call in calls if call.startswith("cmake --build")], ["product"])


if __name__ == "__main__":
    unittest.main()
