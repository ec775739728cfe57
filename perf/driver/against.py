"""./dev perf --against REV: builds another version of the hub beside this one and measures both in turns, in pairs."""

import os
import pathlib
import subprocess
import sys

from driver.measure import Settings, run_once, say
from driver.statistics_of_pairs import PAIRS_MIN, Comparison, compare
from driver.subjects import TcpHub, allowed_cpus
from driver.suite import Case

PAIRS = 12
PAIR_SECONDS = 0.3
CASES = tuple(Case(scenario, size, "tcp") for scenario, size in
              (("one_to_one", 16), ("one_to_one", 4096), ("one_to_one", 65536), ("one_to_one_unbatched", 16),
               ("in_turns", 16), ("fan_out_100", 16), ("ping_one_cpu", 16)))


class BuildError(Exception):
    """The other version cannot be had."""


def run_loudly(command: list[str], **options) -> None:
    say("+ " + " ".join(command))
    if subprocess.run(command, stdout=sys.stderr, stdin=subprocess.DEVNULL, **options).returncode != 0:
        raise BuildError(f"{' '.join(command[:3])} ... failed")


def commit_of(root: pathlib.Path, revision: str) -> str:
    command = ["git", "-C", str(root), "rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}"]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise BuildError(f"git cannot be run: {error}") from None
    if done.returncode != 0:
        raise BuildError(f"there is no version '{revision}': give a commit, a branch or a tag of this repository")
    return done.stdout.strip()


def build_version(root: pathlib.Path, revision: str) -> tuple[str, pathlib.Path]:
    """The commit, and the folder of its release build: a work tree under build/, which is kept for the next time."""
    commit = commit_of(root, revision)
    tree = root / "build" / "against" / commit[:12]
    if not (tree / "CMakeLists.txt").exists():
        tree.parent.mkdir(parents=True, exist_ok=True)
        # Forced twice: a tree that was deleted by hand is still known.
        run_loudly(["git", "-C", str(root), "worktree", "add", "--force", "--force", "--detach", str(tree), commit])
    parts = [f"-DGIMNET_{part}=OFF" for part in ("TESTS", "BENCH", "PERF")]
    run_loudly(["cmake", "--preset", "release", *parts], cwd=tree)
    jobs = os.environ.get("GIMNET_JOBS", str(os.cpu_count() or 1))
    run_loudly(["cmake", "--build", "--preset", "release", "-j", jobs, "--target", "tcphub"], cwd=tree)
    return commit, tree / "build" / "release"


def measure_once(build: pathlib.Path, case: Case, settings: Settings) -> float:
    return run_once(TcpHub(build, allowed_cpus()[:1], settings.hub_arguments), case, settings)[case.spec.metric]


def compare_case(case: Case, other: pathlib.Path, pairs: int, settings: Settings) -> Comparison:
    """A pair is both versions one after the other, the first of which changes from pair to pair."""
    old, new = [], []
    for pair in range(pairs):
        order = [(other, old), (settings.build, new)]
        for build, figures in order if pair % 2 == 0 else reversed(order):
            figures.append(measure_once(build, case, settings))
    return compare(old, new)


def describe(case: Case, comparison: Comparison) -> str:
    change, low, high = ((each - 1) * 100 for each in (comparison.ratio, comparison.low, comparison.high))
    return (f"{str(case):32} {case.spec.metric:20} {change:+6.1f} %  (95 %: {low:+.1f} to {high:+.1f})  "
            f"{comparison.verdict}, confidence {comparison.confidence:.1%}, {comparison.pairs} pairs")


def compare_versions(root: pathlib.Path, revision: str, cases: list[Case], pairs: int, settings: Settings) -> dict:
    """The JSON document. Raises BuildError, SubjectError."""
    if pairs < PAIRS_MIN:
        raise BuildError(f"{pairs} pairs cannot show a difference: at least {PAIRS_MIN}")
    commit, other = build_version(root, revision)
    say(f"this version against {revision} ({commit[:12]}):")
    comparisons = []
    for case in cases:
        comparison = compare_case(case, other, pairs, settings)
        say(describe(case, comparison))
        comparisons.append({"scenario": case.scenario, "size": case.size, "transport": case.transport,
                            "metric": case.spec.metric, "ratio": comparison.ratio, "low": comparison.low,
                            "high": comparison.high, "confidence": comparison.confidence,
                            "pairs": comparison.pairs, "verdict": comparison.verdict})
    return {"against": revision, "commit": commit, "comparisons": comparisons}
