#!/usr/bin/env python3
"""What cmake --install makes is enough to build and run the examples outside of this tree, from a prefix that was moved: by CMake
and by pkg-config, shared and static, with every compiler that is here.

    install_test.py CMAKE BUILD_FOLDER"""

import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
TIMEOUT_S = 300
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror"]
NOBODY = "tcp://127.0.0.1:1"
PROGRAMS = (("pose.c", "bitestream"), ("hello.c", "nif"), ("publisher.cpp", "gimi"))
PROJECT = f"""cmake_minimum_required(VERSION 3.22)
project(outside LANGUAGES %s)
find_package(gimnet REQUIRED)
add_compile_options({' '.join(STRICT)})
"""
TARGET = """add_executable({name}{kind} {source})
target_link_libraries({name}{kind} PRIVATE gimnet::{library}{kind})
"""


def compilers():
    """(C compiler, C++ compiler with its options): GCC, clang, and clang with its own C++ library."""
    found = [["gcc", "g++"]]
    for suffix in ("-19", ""):
        if shutil.which(f"clang++{suffix}"):
            found += [[f"clang{suffix}", f"clang++{suffix}"], [f"clang{suffix}", f"clang++{suffix} -stdlib=libc++"]]
            break
    return found


def has_library(cxx):
    """Whether its C++ library is installed."""
    return subprocess.run([*shlex.split(cxx), "-xc++", "-fsyntax-only", "-"], input="#include <vector>\n", text=True,
                          stderr=subprocess.DEVNULL, timeout=TIMEOUT_S, check=False).returncode == 0


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        first = cls.folder / "first"
        for component in ("runtime", "development", "tools", "hub", "python"):
            cls.run_command([CMAKE, "--install", BUILD, "--prefix", first, "--component", component])
        cls.prefix = first.rename(cls.folder / "moved")
        cls.library = cls.prefix / "lib"

    @staticmethod
    def run_command(command, **environment):
        done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              env=os.environ | environment, timeout=TIMEOUT_S, check=False)
        if done.returncode != 0:
            raise AssertionError(f"{shlex.join(map(str, command))}\n{done.stdout}{done.stderr}")
        return done.stdout

    def check_program(self, program, is_shared):
        """It runs, with the library of the prefix, and the shared library is asked for where it should be."""
        ran = subprocess.run([program], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
                             env={"GIMNET_HUB": NOBODY, "LD_LIBRARY_PATH": str(self.library)})
        if program.name.startswith("pose"):
            self.assertEqual((ran.returncode, ran.stdout.splitlines()[0]), (0, "robot is at x 0.5"))
        else:
            self.assertEqual(ran.returncode, 1)
            self.assertIn(NOBODY, ran.stderr)
        needed = self.run_command(["readelf", "--dynamic", program])
        self.assertEqual("[libgimnet.so.1]" in needed, is_shared, program.name)

    def by_cmake(self, name, languages, c, cxx, programs):
        source, build = self.folder / name, self.folder / name / "build"
        source.mkdir()
        targets = [(example, library, kind) for example, library in programs for kind in ("", "_static")]
        (source / "CMakeLists.txt").write_text(PROJECT % languages + "".join(
            TARGET.format(name=example.split(".")[0], source=EXAMPLES / example, library=library, kind=kind)
            for example, library, kind in targets))
        cxx, *options = shlex.split(cxx)
        self.run_command([CMAKE, "-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={self.prefix}",
                          f"-DCMAKE_C_COMPILER={c}", f"-DCMAKE_CXX_COMPILER={cxx}", f"-DCMAKE_CXX_FLAGS={shlex.join(options)}"])
        self.run_command([CMAKE, "--build", build, "-j", "2"])
        for example, _, kind in targets:
            self.check_program(build / f"{example.split('.')[0]}{kind}", not kind)

    def test_by_cmake_and_by_pkg_config_with_every_compiler(self):
        for number, (c, cxx) in enumerate(compilers()):
            with self.subTest(cxx):
                if not has_library(cxx):
                    print(f"NOT TESTED with {cxx}: its C++ library is not installed (libc++-dev)", file=sys.stderr)
                    continue
                self.by_cmake(f"cmake{number}", "C CXX", c, cxx, PROGRAMS)
                self.by_pkg_config(f"pkg{number}", c, cxx)

    def by_pkg_config(self, name, c, cxx):
        (self.folder / name).mkdir()
        for example, library in PROGRAMS:
            for kind in ([], ["--static"]):
                if kind and "libc++" in cxx:
                    continue  # a program without shared libraries would need libc++ as an archive too
                flags = self.run_command(["pkg-config", *kind, "--cflags", "--libs", library],
                                         PKG_CONFIG_PATH=str(self.library / "pkgconfig")).split()
                compiler = [c, "-std=c11"] if example.endswith(".c") else [*shlex.split(cxx), "-std=c++20"]
                program = self.folder / name / f"{example.split('.')[0]}{''.join(kind)}"
                self.run_command([*compiler, *(["-static"] if kind else []), *STRICT, EXAMPLES / example, *flags, "-o", program])
                self.check_program(program, not kind)

    def test_all_examples_run_with_hub_and_libraries_of_the_prefix(self):
        programs = self.folder / "examples"
        programs.mkdir()
        for source in sorted(EXAMPLES.glob("*.c*")):
            compiler = ["gcc", "-std=c11"] if source.suffix == ".c" else ["g++", "-std=c++20", "-O0"]
            flags = self.run_command(["pkg-config", "--cflags", "--libs", "gimi"],
                                     PKG_CONFIG_PATH=str(self.library / "pkgconfig")).split()
            self.run_command([*compiler, *STRICT, source, *flags, "-o", programs / source.stem])
        self.run_command([sys.executable, ROOT / "tests" / "system" / "examples_test.py"], GIMNET_EXAMPLES=str(programs),
                         GIMNET_BIN=str(self.prefix / "bin"), LD_LIBRARY_PATH=str(self.library), GIMNET_LIBRARY="",
                         PYTHONPATH=str(self.library / "python3" / "dist-packages"))

    def test_a_project_in_c_alone_needs_no_cpp_compiler(self):
        self.by_cmake("only_c", "C", "gcc", "no-such-compiler", PROGRAMS[:2])

    def test_development_alone_is_enough_to_link_and_run(self):
        alone = self.folder / "alone"
        self.run_command([CMAKE, "--install", BUILD, "--prefix", alone, "--component", "development"])
        names = {path.name for path in (alone / "lib").iterdir()}
        self.assertLessEqual({"libgimnet.so", "libgimnet.so.1", "libgimnet.a", "libbitestream.a"}, names)

    def test_nothing_names_the_tree_or_the_first_prefix(self):
        for path in self.prefix.rglob("*"):
            if path.suffix in (".cmake", ".pc"):
                for folder in (ROOT, BUILD, self.folder):
                    self.assertNotIn(str(folder), path.read_text(), path.name)

    def test_python_finds_the_library_of_its_prefix(self):
        package = self.library / "python3" / "dist-packages"
        said = self.run_command([sys.executable, "-c", "import gimnet; print(gimnet.node._c.lib._name)"], PYTHONPATH=str(package),
                                PYTHONDONTWRITEBYTECODE="1", GIMNET_LIBRARY="")
        self.assertEqual(pathlib.Path(said.strip()), (self.library / "libgimnet.so.1").resolve())

    def test_programs_run_from_the_prefix(self):
        for program in ("tcphub", "gimnet"):
            self.assertIn(program, self.run_command([self.prefix / "bin" / program, "--help"]))


if __name__ == "__main__":
    BUILD = pathlib.Path(sys.argv.pop()).resolve()
    CMAKE = sys.argv.pop()
    unittest.main()
