#!/usr/bin/env python3
"""The sources of the hub that include Boost compile with the headers of Boost 1.74, whichever is installed.

Usage: boost174_test.py BUILD_FOLDER"""

import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SKIPPED = 77
TIMEOUT_S = 120
VERSION = """#include <boost/version.hpp>
#if BOOST_VERSION / 100 != 1074
#error "these are not the headers of Boost 1.74"
#endif
"""


def headers():
    """The folder of the headers; None, with the reason on standard error, where they cannot be had."""
    try:
        door = subprocess.run([ROOT / "dev", "boost174", "--headers"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
                              timeout=TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        print("the download of libboost1.74-dev did not end", file=sys.stderr)
        return None
    return door.stdout.strip() if door.returncode == 0 else None


def sources_with_boost():
    """Those that include it, and for a header the sources whose own headers include that."""
    sources, names, left = set(), set(), [r"#include <boost/"]
    files = [file for file in (ROOT / "src").rglob("*") if file.suffix in (".cpp", ".hpp")]
    while left:
        wanted = re.compile(left.pop(), re.M)
        for file in files:
            if not wanted.search(file.read_text()):
                continue
            name = file.relative_to(ROOT / "src").as_posix()
            if file.suffix == ".cpp":
                sources.add(file)
            elif name not in names:
                names.add(name)
                own = file.with_suffix(".cpp")
                if own.exists():
                    sources.add(own)
                else:
                    left.append(f'#include "{re.escape(name)}"')
    return sorted(sources)


class Boost174(unittest.TestCase):
    def test_sources_that_include_boost_compile(self):
        entries = {entry["file"]: entry for entry in json.loads((BUILD / "compile_commands.json").read_text())}
        sources = sources_with_boost()
        self.assertGreaterEqual(len(sources), 2, "one waits with Asio, one has a map")
        with tempfile.TemporaryDirectory() as folder:
            version = pathlib.Path(folder) / "version.hpp"
            version.write_text(VERSION)
            for source in sources:
                entry = entries[str(source)]
                command = shlex.split(entry["command"])
                if pathlib.Path(command[0]).name == "ccache":
                    del command[0]
                command[1:1] = ["-isystem", HEADERS, "-include", str(version), "-fsyntax-only"]
                del command[command.index("-o"):command.index("-o") + 2]
                with self.subTest(source=source):
                    compiler = subprocess.run(command, cwd=entry["directory"], stdin=subprocess.DEVNULL, capture_output=True,
                                              text=True, timeout=TIMEOUT_S, check=False)
                    self.assertEqual(compiler.returncode, 0, compiler.stderr)


if __name__ == "__main__":
    BUILD = pathlib.Path(sys.argv.pop(1))
    HEADERS = headers()
    if HEADERS is None:
        print("SKIPPED: the headers of Boost 1.74 cannot be had: see above", file=sys.stderr)
        sys.exit(SKIPPED)
    unittest.main()
