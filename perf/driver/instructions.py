"""Instructions per frame of the hub's hot parts (perf/instructions/scripts.cpp), counted by valgrind's callgrind against
perf/instructions/budget.json, with what they call in libraries (copies, memory). The same on every machine: the C library is told
which of its copies to take (LIBRARY_TUNING), which it would choose by the processor. System calls are counted by
tests/hub/shard/system_calls_test.cpp."""

import collections
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass

SCRIPTS = pathlib.Path(__file__).resolve().parent.parent / "instructions" / "scripts.cpp"
BUDGET = pathlib.Path(__file__).resolve().parent.parent / "instructions" / "budget.json"
TOLERANCE = 0.02  # of one change, against the budget
# Many small changes, each within the tolerance, must not add up: all together, against the base.
BASE = pathlib.Path(__file__).resolve().parent.parent / "instructions" / "base.json"
BASE_TOLERANCE = 0.03
SECONDS_MAX = 250  # of one program: what takes longer hangs, however loaded the machine is
# The function below which counting is on (perf/instructions/*.cpp).
COUNTED = "counted"
# What plays the nodes is not the hub.
NOT_COUNTED = ("::testing::", "MemoryStream", "MemoryPipe", "MemoryPeer")
# glibc's tunables: its copies for a processor without AVX, and none by way of memory where much is copied, which depends on the cache.
LIBRARY_TUNING = ("glibc.cpu.hwcaps=-AVX_Fast_Unaligned_Load,-AVX2,-AVX512F,-AVX512VL,-SSSE3,-SSE4_1,-SSE4_2,-ERMS"
                  ":glibc.cpu.x86_non_temporal_threshold=0x10000000")


class CountingError(Exception):
    """The counts were not had. A gate that lets this pass would be open for every script that crashes."""


class NotCountable(CountingError):
    """They cannot be had here, whatever the code is: the only reason to leave a gate out."""


@dataclass(frozen=True)
class Verdict:
    """One script against its budget, both in instructions per frame."""

    script: str
    counted: float
    budget: float | None
    base: float | None = None
    base_tolerance: float = BASE_TOLERANCE

    @property
    def is_above_base(self) -> bool:
        return self.base is not None and self.counted > self.base * (1 + self.base_tolerance)

    @property
    def change(self) -> float | None:
        return self.counted / self.budget - 1 if self.budget else None

    @property
    def is_slower(self) -> bool:
        return self.budget is None or self.counted > self.budget * (1 + TOLERANCE)

    @property
    def is_faster(self) -> bool:
        return self.budget is not None and self.counted < self.budget * (1 - TOLERANCE)

    def __str__(self) -> str:
        if self.budget is None:
            return f"{self.script:22} {self.counted:8.1f}  has no budget: ./dev perf --instructions --update"
        word = "SLOWER" if self.is_slower else "faster" if self.is_faster else ""
        base = f"  base {self.base:8.1f}  {self.counted / self.base - 1:+7.2%}" if self.base else ""
        if self.is_above_base:
            word = f"{word}  ABOVE THE BASE (at most {self.base_tolerance:+.0%})"
        return (f"{self.script:22} {self.counted:8.1f}  budget {self.budget:8.1f}  {self.change:+7.2%}{base}"
                f"  {word}").rstrip()


@dataclass(frozen=True)
class Costs:
    """Instructions of the counted runs."""

    total: int
    by_function: collections.Counter  # of each function of the program, with what it calls in libraries


def hub_costs(profile: str, program: str) -> Costs:
    """What callgrind's uncompressed output says of the hub: what runs below counted(), in the program and in libraries, but for
    what those who play the nodes do and call."""
    total = 0
    costs: collections.Counter = collections.Counter()
    owner = function = callee_owner = callee = ""
    is_of_a_callee = False
    for line in profile.splitlines():
        if line.startswith("ob="):
            owner = line[3:]
        elif line.startswith("fn="):
            function = line[3:]
        elif line.startswith("cob="):
            callee_owner = line[4:]
        elif line.startswith("cfn="):
            callee = line[4:]
        elif line.startswith("calls="):
            is_of_a_callee = True  # the next line is what the callee took, with all that it called
        elif line[:1].isdigit() or line[:1] in ("+", "-", "*"):
            cost = int(line.split()[1])
            if is_of_a_callee:
                if callee == COUNTED:
                    total += cost
                elif is_of_nodes(callee) and not is_of_nodes(function):
                    total -= cost
            # Libraries that call each other are in what they cost the first caller.
            if owner == program and not is_of_nodes(function) and (not is_of_a_callee or callee_owner not in ("", program)):
                costs[function] += cost
            if is_of_a_callee:
                is_of_a_callee, callee_owner = False, ""
    return Costs(total, costs)


def is_of_nodes(function: str) -> bool:
    return any(word in function for word in NOT_COUNTED)


def run_program(command: list[str]) -> str:
    # A bare environment: its size moves the stack, and with it what depends on alignment.
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_MAX, stdin=subprocess.DEVNULL,
                              env={"PATH": os.environ.get("PATH", os.defpath), "GLIBCXX_FORCE_NEW": "1",
                                   "GLIBC_TUNABLES": LIBRARY_TUNING})
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CountingError(f"{command[0]}: {error}") from None
    if done.returncode != 0:
        raise CountingError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr.strip()[-500:]}")
    return done.stdout


def describe(program: pathlib.Path) -> tuple[dict, list[str]]:
    """What the program was compiled by, and its scripts."""
    if not program.exists():
        raise CountingError(f"{program} is not there: build it first (./dev build instruction_scripts)")
    first, *scripts = run_program([str(program)]).splitlines()
    compiler, processor, build, libc = first.rsplit(" ", 3)
    return {"compiler": compiler, "processor": processor, "build": build, "libc": libc}, scripts


def count(program: pathlib.Path, script: str) -> tuple[float, dict[str, float]]:
    """Instructions per frame of a script, and by function, the most expensive first."""
    if shutil.which("valgrind") is None:
        raise NotCountable("valgrind is not installed (package valgrind)")
    with tempfile.TemporaryDirectory(prefix="gimnet-instructions-") as folder:
        profile = pathlib.Path(folder, "profile")
        frames = int(run_program(["valgrind", "--tool=callgrind", "--collect-atstart=no", f"--toggle-collect={COUNTED}",
                                  "--compress-strings=no", "--compress-pos=no", f"--callgrind-out-file={profile}",
                                  str(program), script]))
        costs = hub_costs(profile.read_text(), str(program))
    if costs.total <= 0:
        raise CountingError(f"callgrind counted nothing in {program} {script}")
    return costs.total / frames, {function: cost / frames for function, cost in costs.by_function.most_common()}


def load_budget() -> dict:
    return json.loads(BUDGET.read_text()) if BUDGET.exists() else {"made_by": {}, "instructions_per_frame": {}}


def require_comparable(made_by: dict, budget: dict) -> None:
    """Another compiler, processor, kind of build or C library makes other instructions: then the budget says nothing. Raises NotCountable."""
    if made_by != budget["made_by"]:
        raise NotCountable(f"the budget is for {' '.join(budget['made_by'].values()) or 'nothing yet'}; this is {' '.join(made_by.values())}")


def known_scripts() -> list[str]:
    """Those of the source, so that a wrong name is told before anything is built."""
    return re.findall(r'^    \{"(\w+)", ', SCRIPTS.read_text(), re.MULTILINE)


def require_script(script: str, scripts: list[str]) -> None:
    if script not in scripts:
        raise CountingError(f"there is no script '{script}'; give one of {', '.join(scripts)}")


def load_base() -> dict:
    """{"instructions_per_frame": {script: count}, "allowed": {script: {"tolerance": part, "why": sentence}}}"""
    return json.loads(BASE.read_text())


def measure(program: pathlib.Path, scripts: list[str], budget: dict) -> list[Verdict]:
    known, base = budget["instructions_per_frame"], load_base()
    return [Verdict(script, round(count(program, script)[0], 2), known.get(script),
                    base["instructions_per_frame"].get(script),
                    base["allowed"].get(script, {}).get("tolerance", BASE_TOLERANCE)) for script in scripts]


def update_budget(made_by: dict, verdicts: list[Verdict]) -> None:
    BUDGET.write_text(json.dumps({"made_by": made_by, "instructions_per_frame":
                                  {verdict.script: verdict.counted for verdict in verdicts}}, indent=2) + "\n")
