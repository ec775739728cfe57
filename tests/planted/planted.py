#!/usr/bin/env python3
"""Deliberate bugs that prove the checks: planted.py check | list | write NAME FOLDER | run BUILD_FOLDER [NAME...]

bugs.toml names each bug, the edits that make it, and the one program that must find it. `check` verifies that
each edit matches exactly one place. `list` prints a line for each bug, for CMake. `write` writes the changed
copies of the sources below FOLDER. `run` starts the programs that CMake built with the bugs and looks whether
each finds its bug; without names it runs all that the build folder has.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TABLE = ROOT / "tests" / "planted" / "bugs.toml"
SIMULATIONS = ("gimnet-sim", "gimnet-sim-routes", "gimnet-sim-hubs")
FUZZ_SECONDS = 60  # a fuzz target has so long for its bug
SLOW_LEAST, SLOW_MOST = 0.03, 0.08  # a planted slow-down adds about a twentieth, to show that no half is needed


class Mistake(Exception):
    """The table says something that is not so."""


@dataclass
class Edit:
    file: str
    find: str
    replace: str


@dataclass
class Bug:
    name: str
    breaks: str
    program: str
    edits: list[Edit]
    argument: str = ""  # the checker of a simulation, or the script of instruction_scripts
    compiles: list[str] = field(default_factory=list)  # sources that include a changed header
    quick: bool = False  # ./dev test runs it

    @property
    def target(self) -> str:
        return f"planted.{self.name.lower()}"

    def files(self) -> list[str]:
        return sorted({edit.file for edit in self.edits})


def load(table: str | None = None) -> list[Bug]:
    """The bugs of a table, given as text; by default of bugs.toml."""
    bugs = []
    for entry in tomllib.loads(TABLE.read_text(encoding="utf-8") if table is None else table).get("bug", []):
        edits = [Edit(**edit) for edit in entry.pop("edit", [])]
        bug = Bug(edits=edits, **entry)
        if not edits:
            raise Mistake(f"{bug.name} has no edit")
        bugs.append(bug)
    names = [bug.name for bug in bugs]
    for name in sorted({name for name in names if names.count(name) > 1}):
        raise Mistake(f"two bugs are named {name}")
    return bugs


def span(text: str, find: str) -> tuple[int, int]:
    """The one place in the text that reads like `find`, white space ignored."""
    places = [i for i, c in enumerate(text) if not c.isspace()]
    dense = "".join(text[i] for i in places)
    wanted = "".join(find.split())
    if not wanted:
        raise Mistake("an empty text to find")
    first = dense.find(wanted)
    if first < 0:
        raise Mistake(f"not there: {find.strip()!r}")
    if dense.find(wanted, first + 1) >= 0:
        raise Mistake(f"there more than once: {find.strip()!r}")
    return places[first], places[first + len(wanted) - 1] + 1


def read_source(file: str) -> str:
    return (ROOT / file).read_text(encoding="utf-8")


def changed(bug: Bug, read: Callable[[str], str] = read_source) -> dict[str, str]:
    """The texts of the changed files, by path from the root."""
    texts: dict[str, str] = {}
    for edit in bug.edits:
        try:
            text = texts.get(edit.file) or read(edit.file)
            begin, end = span(text, edit.find)
        except (Mistake, OSError) as error:
            raise Mistake(f"{bug.name}: {edit.file}: {error}") from None
        texts[edit.file] = text[:begin] + edit.replace.strip("\n") + text[end:]
    return texts


def check(bugs: list[Bug], read: Callable[[str], str] = read_source) -> list[str]:
    """All mistakes of the table."""
    mistakes = []
    for bug in bugs:
        try:
            changed(bug, read)
        except Mistake as mistake:
            mistakes.append(str(mistake))
    return mistakes


def write(bug: Bug, folder: pathlib.Path) -> None:
    for file, text in changed(bug).items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


# ---- running ----


def found_by_fuzzer(bug: Bug, program: pathlib.Path, build: pathlib.Path) -> bool:
    """A crash file is the proof, not the exit status: a program that cannot start also ends with an error."""
    folder = build / "planted" / bug.name / "run"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "crashes").mkdir(parents=True)
    (folder / "corpus").mkdir()
    seeds = ROOT / "fuzz" / "seeds" / bug.program
    command = [program, f"-max_total_time={FUZZ_SECONDS}", "-timeout=10", "-rss_limit_mb=1024",
               f"-dict={ROOT / 'fuzz' / 'gimnet.dict'}", f"-artifact_prefix={folder / 'crashes'}/", folder / "corpus"]
    subprocess.run(command + ([seeds] if seeds.is_dir() else []), stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, check=False)
    return any((folder / "crashes").iterdir())


def found_by_simulation(bug: Bug, program: pathlib.Path) -> bool:
    answer = subprocess.run([program, "--seeds", "500", "--expect", bug.argument], capture_output=True, text=True,
                            check=False)
    if answer.returncode != 0:
        print(answer.stdout[-2000:], answer.stderr[-2000:])
    return answer.returncode == 0


def found_by_unit_test(program: pathlib.Path) -> bool:
    """Googletest ends with 1 for a failed test; a broken invariant aborts."""
    return subprocess.run([program], stdout=subprocess.DEVNULL, check=False).returncode != 0


def found_by_counting(bug: Bug, program: pathlib.Path, build: pathlib.Path) -> bool | None:
    """None: instructions cannot be counted here."""
    sys.path.insert(0, str(ROOT / "perf"))
    from driver import instructions  # noqa: E402, PLC0415: only this needs it

    budget = instructions.load_budget()
    clean_program = build / "bin" / "instruction_scripts"
    try:
        made_by, _ = instructions.describe(clean_program)
        if made_by["build"] != "release":
            raise instructions.NotCountable("a build without optimisation says nothing of a twentieth")
        instructions.require_comparable(made_by, budget)
        slow = instructions.measure(program, [bug.argument], budget)[0]
        clean = instructions.measure(clean_program, [bug.argument], budget)[0]
    except instructions.NotCountable as error:
        print(f"SKIPPED: {error}")
        return None
    more = slow.counted / clean.counted - 1
    print(f"{bug.name}: {bug.argument} {more:+.2%}")
    return slow.is_slower and not clean.is_slower and SLOW_LEAST < more < SLOW_MOST


def found(bug: Bug, build: pathlib.Path) -> bool | None:
    program = build / "bin" / bug.target
    if bug.program.endswith("_fuzz"):
        return found_by_fuzzer(bug, program, build)
    if bug.program in SIMULATIONS:
        return found_by_simulation(bug, program)
    if bug.program == "instruction_scripts":
        return found_by_counting(bug, program, build)
    return found_by_unit_test(program)


def run(bugs: list[Bug], build: pathlib.Path, names: list[str]) -> int:
    known = {bug.name for bug in bugs}
    for name in names:
        if name not in known:
            raise Mistake(f"there is no bug {name}: planted.py list")
    passed = failed = skipped = 0
    for bug in bugs:
        if names and bug.name not in names:
            continue
        if not os.access(build / "bin" / bug.target, os.X_OK):
            if names:
                raise Mistake(f"{bug.target} is not built")
            continue
        print(f"{bug.name}: {bug.program} must find it", flush=True)
        verdict = found(bug, build)
        if verdict is None:
            skipped += 1
        elif verdict:
            passed += 1
        else:
            failed += 1
            print(f"{bug.name}: NOT found by {bug.program} ({bug.breaks})", flush=True)
    print(f"{passed} passed, {failed} failed, {skipped} skipped")
    if failed or not passed + skipped:
        return 1
    return 0 if passed else 77


def main(arguments: list[str]) -> int:
    bugs = load()
    match arguments:
        case ["check"]:
            mistakes = check(bugs)
            print("\n".join(mistakes), end="\n" if mistakes else "")
            return 1 if mistakes else 0
        case ["list"]:
            for bug in bugs:
                words = [bug.name, bug.target, bug.program, "quick" if bug.quick else "long", ",".join(bug.files()),
                         ",".join(bug.compiles)]
                print("|".join(words))
            return 0
        case ["write", name, folder]:
            for bug in bugs:
                if bug.name == name:
                    write(bug, pathlib.Path(folder))
                    return 0
            raise Mistake(f"there is no bug {name}")
        case ["run", build, *names]:
            return run(bugs, pathlib.Path(build).resolve(), names)
    print(__doc__.splitlines()[0], file=sys.stderr)
    return 2


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Mistake as mistake:
        print(f"planted.py: {mistake}", file=sys.stderr)
        sys.exit(2)
