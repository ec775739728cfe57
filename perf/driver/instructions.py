"""Instructions per frame of the hub's hot parts (perf/instructions/scripts.cpp), counted by valgrind's callgrind against
perf/instructions/budget.json: the same on every machine, since only the program's own functions are counted, not the
libraries', which choose their code by the processor."""

import collections
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
from dataclasses import dataclass

BUDGET = pathlib.Path(__file__).resolve().parent.parent / "instructions" / "budget.json"
TOLERANCE = 0.02
SECONDS_MAX = 250  # of one program: what takes longer hangs, however loaded the machine is
# What plays the nodes is not the hub.
NOT_COUNTED = ("::testing::", "counted", "MemoryTransport", "MemoryPipe")


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
        return f"{self.script:22} {self.counted:8.1f}  budget {self.budget:8.1f}  {self.change:+7.2%}  {word}".rstrip()


def own_costs(profile: str, program: str) -> collections.Counter:
    """Instructions by function, from callgrind's uncompressed output: those of `program` itself, without callees'."""
    costs: collections.Counter = collections.Counter()
    owner = function = ""
    is_of_a_callee = False
    for line in profile.splitlines():
        if line.startswith("ob="):
            owner = line[3:]
        elif line.startswith("fn="):
            function = line[3:]
        elif line.startswith("calls="):
            is_of_a_callee = True  # the next line is what the callee took
        elif line[:1].isdigit() or line[:1] in ("+", "-", "*"):
            if not is_of_a_callee and owner == program and not any(word in function for word in NOT_COUNTED):
                costs[function] += int(line.split()[1])
            is_of_a_callee = False
    return costs


def run_program(command: list[str]) -> str:
    # A bare environment: its size moves the stack, and with it what depends on alignment.
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_MAX, stdin=subprocess.DEVNULL,
                              env={"PATH": os.environ.get("PATH", os.defpath), "GLIBCXX_FORCE_NEW": "1"})
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
    compiler, processor, build = first.rsplit(" ", 2)
    return {"compiler": compiler, "processor": processor, "build": build}, scripts


def count(program: pathlib.Path, script: str) -> tuple[float, collections.Counter]:
    """Instructions per frame of a script, and by function."""
    if shutil.which("valgrind") is None:
        raise NotCountable("valgrind is not installed (package valgrind)")
    with tempfile.TemporaryDirectory(prefix="gimnet-instructions-") as folder:
        profile = pathlib.Path(folder, "profile")
        frames = int(run_program(["valgrind", "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=counted",
                                  "--skip-plt=no", "--compress-strings=no", "--compress-pos=no", f"--callgrind-out-file={profile}",
                                  str(program), script]))
        costs = own_costs(profile.read_text(), str(program))
    if not costs:
        raise CountingError(f"callgrind counted nothing in {program} {script}")
    return sum(costs.values()) / frames, costs


def load_budget() -> dict:
    return json.loads(BUDGET.read_text()) if BUDGET.exists() else {"made_by": {}, "instructions_per_frame": {}}


def require_comparable(made_by: dict, budget: dict) -> None:
    """Another compiler, processor or kind of build makes other instructions: then the budget says nothing. Raises NotCountable."""
    if made_by != budget["made_by"]:
        raise NotCountable(f"the budget is for {' '.join(budget['made_by'].values()) or 'nothing yet'}; this is {' '.join(made_by.values())}")


def require_script(script: str, scripts: list[str]) -> None:
    if script not in scripts:
        raise CountingError(f"there is no script '{script}'; there are {', '.join(scripts)}")


def measure(program: pathlib.Path, scripts: list[str], budget: dict) -> list[Verdict]:
    known = budget["instructions_per_frame"]
    return [Verdict(script, round(count(program, script)[0], 2), known.get(script)) for script in scripts]


def update_budget(made_by: dict, verdicts: list[Verdict]) -> None:
    BUDGET.write_text(json.dumps({"made_by": made_by, "instructions_per_frame":
                                  {verdict.script: verdict.counted for verdict in verdicts}}, indent=2) + "\n")
