#!/usr/bin/env python3
"""The programs of tests/abi/programs, compiled and kept, which every later library must run.

    kept.py LIBRARY_FOLDER VERSION      compiles them into tests/abi/kept/VERSION, for a release

A program that was kept is never compiled again: it stands for those that users have."""

import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
INCLUDE = HERE.parents[1] / "include"
SOURCES = HERE / "programs"
KEPT = HERE / "kept"
# All kept programs of a version; the repository has them for ever.
BYTES_MAX = 256 * 1024
TIMEOUT_S = 120


def compile_programs(library_folder, folder):
    """`program_c`, `program_cpp` and `plugin.so`, stripped."""
    library = [f"-L{library_folder}", "-l:libgimnet.so.1"]
    common = ["-Os", "-s", f"-I{INCLUDE}", f"-I{SOURCES}"]
    for command in (["gcc", "-std=c11", *common, SOURCES / "program.c", *library, "-o", folder / "program_c"],
                    ["g++", "-std=c++20", *common, SOURCES / "program.cpp", *library, "-ldl", "-o", folder / "program_cpp"],
                    ["g++", "-std=c++20", "-fPIC", "-shared", "-fvisibility-inlines-hidden", *common, SOURCES / "plugin.cpp", *library,
                     "-o", folder / "plugin.so"]):
        subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, timeout=TIMEOUT_S, check=True)
    size = sum(path.stat().st_size for path in folder.iterdir())
    if size > BYTES_MAX:
        raise SystemExit(f"the programs have {size} bytes; {BYTES_MAX} are enough")


def folders():
    """Of the versions that are kept."""
    return sorted(KEPT.iterdir()) if KEPT.exists() else []


if __name__ == "__main__":
    library_folder, version = sys.argv[1:]
    folder = KEPT / version
    folder.mkdir(parents=True)  # fails if that version is kept already
    compile_programs(pathlib.Path(library_folder).resolve(), folder)
    print(f"kept in {folder}: commit it")
