#!/usr/bin/env python3
"""Do two builds of the simulation make the same of the same seeds?

    same_trace.py SEEDS PROGRAM FOLDER OTHER_PROGRAM OTHER_FOLDER

In each FOLDER are the hashes that the tests of the worlds wrote when they ran the program beside it, in files of lines
`SEED HASH`. Worlds of which there is none that is newer than the program are run here: so the order of the tests does not
matter, and no world is run twice where all were. `-` is no folder. Ends with 77, which ctest counts as skipped, where the
other program is not there or is older than the sources."""

import subprocess
import sys
from pathlib import Path

SKIPPED = 77
ROOT = Path(__file__).resolve().parents[2]


def read_hashes(text):
    return {int(seed): value for seed, value in (line.split() for line in text.splitlines())}


def noted_hashes(program, folder):
    """What is newer than the program: another program's worlds were perhaps other ones."""
    found = {}
    if folder != "-" and Path(folder).is_dir():
        built = Path(program).stat().st_mtime_ns
        for path in Path(folder).iterdir():
            if path.stat().st_mtime_ns > built:
                found.update(read_hashes(path.read_text(encoding="ascii")))
    return found


def runs(seeds):
    """(first, count) of what follows one another in ascending numbers."""
    found = []
    for seed in seeds:
        if found and sum(found[-1]) == seed:
            found[-1] = (found[-1][0], found[-1][1] + 1)
        else:
            found.append((seed, 1))
    return found


def hashes(program, folder, seeds):
    found = noted_hashes(program, folder)
    missing = [seed for seed in seeds if seed not in found]
    for first, count in runs(missing):
        done = subprocess.run([program, "--hashes", "--from", str(first), "--seeds", str(count)], capture_output=True,
                              text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"{program} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
        found.update(read_hashes(done.stdout))
    print(f"{program}: {len(seeds) - len(missing)} worlds had been run, {len(missing)} were run now")
    return {seed: found.get(seed) for seed in seeds}


def newest_source():
    """Of the program's own sources: the folders in tests/sim hold those of other programs."""
    sources = [path for folder in ("src/base", "src/proto", "src/hub") for path in (ROOT / folder).rglob("*.?pp")]
    return max(path.stat().st_mtime for path in [*sources, *(ROOT / "tests/sim").glob("*.?pp")])


def main():
    count, program, folder, other, other_folder = sys.argv[1:6]
    if not Path(other).exists() or Path(other).stat().st_mtime < newest_source():
        print(f"{other} is not there, or older than the sources: ./dev build gimnet-sim")
        return SKIPPED
    seeds = range(1, int(count) + 1)
    ours, theirs = hashes(program, folder, seeds), hashes(other, other_folder, seeds)
    differing = [f"{seed}: {ours[seed]} in one, {theirs[seed]} in the other" for seed in seeds
                 if ours[seed] is None or ours[seed] != theirs[seed]]
    if differing:
        print("seeds whose hashes differ:", *differing, sep="\n")
        return 1
    print(f"{len(seeds)} seeds, the same hashes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
