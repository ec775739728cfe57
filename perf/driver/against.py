"""./dev perf --against REV: builds another version of the hub beside this one and measures both in turns, in pairs.

Is one of them faster? Everything is of Wilcoxon's signed-rank test, by way of the means of each two differences (Walsh averages): the sum
of ranks on one side is how many of these lie there. So the interval, the verdict and the confidence always say the same."""

import functools
import itertools
import math
import os
import pathlib
import statistics
import subprocess
import sys
from dataclasses import dataclass, field

from driver.measure import Settings, run_with_tries, say
from driver.rows import COUNTED, Fault, faults_of
from driver.subjects import SubjectError, TcpHub, allowed_cpus
from driver.suite import Case

PAIRS = 12
PAIR_SECONDS = 0.3
CASES = tuple(Case(scenario, size, "tcp") for scenario, size in
              (("one_to_one", 16), ("one_to_one", 4096), ("one_to_one", 65536), ("one_to_one_unbatched", 16),
               ("in_turns", 16), ("fan_out_100", 16), ("ping_one_cpu", 16)))
# Of all cases of one comparison together: were there no difference anywhere, in so many of them none would be called one.
CONFIDENCE = 0.95
# No ratio says how much more than nothing something is: this one stands for it, above every other.
RATIO_MAX = 1e6


def pairs_min(cases: int) -> int:
    """Fewer pairs cannot reach that confidence among so many cases, whatever they say: all on one side are 2 of 2^n."""
    pairs = 1
    while 2 / 2**pairs > (1 - CONFIDENCE) / cases:
        pairs += 1
    return pairs


@dataclass(frozen=True)
class Comparison:
    """`ratio` is new to old, of a figure of which less is better."""

    ratio: float
    low: float  # between low and high it lies, with CONFIDENCE for all cases together
    high: float
    p: float  # of the test, for this case alone
    p_of_all: float  # the same among all cases, by Bonferroni
    pairs: int

    @property
    def is_shown(self) -> bool:
        return not self.low <= 1 <= self.high

    @property
    def verdict(self) -> str:
        if not self.is_shown:
            return "no difference shown"
        return "faster" if self.high < 1 else "slower"


def walsh_averages(differences: list[float]) -> list[float]:
    """In order. Their median is the estimate of the difference that belongs to the test (Hodges and Lehmann)."""
    return sorted((one + other) / 2 for one, other in itertools.combinations_with_replacement(differences, 2))


@functools.cache
def tails(count: int) -> list[float]:
    """By sum of ranks: how probable that sum or less is on one side, of `count` differences of which each is on either by chance."""
    total = count * (count + 1) // 2
    ways = [1] + [0] * total  # by sum: how many choices of signs give it
    for rank in range(1, count + 1):
        for sum_so_far in range(total, rank - 1, -1):
            ways[sum_so_far] += ways[sum_so_far - rank]
    return [each / 2**count for each in itertools.accumulate(ways)]


def signed_rank_p(differences: list[float]) -> float:
    """Two-sided p, exact where no two differences are equal in size; what is 0 or equal speaks against a difference."""
    averages = walsh_averages(differences)
    fewest = min(sum(each <= 0 for each in averages), sum(each >= 0 for each in averages))
    return min(1.0, 2 * tails(len(differences))[fewest])


def interval(differences: list[float], cases: int) -> tuple[float, float]:
    """All that the test does not rule out, at the confidence that each of so many cases needs (Bonferroni). Without an end where there
    are fewer pairs than pairs_min()."""
    averages = walsh_averages(differences)
    ruled_out = sum(2 * tail <= (1 - CONFIDENCE) / cases for tail in tails(len(differences)))
    return (averages[ruled_out - 1], averages[-ruled_out]) if ruled_out else (-math.inf, math.inf)


def logarithm_of(old: float, new: float) -> float:
    if old == new:
        return 0.0  # both may be 0
    ratio = new / old if old > 0 else RATIO_MAX
    return math.log(min(max(ratio, 1 / RATIO_MAX), RATIO_MAX))


def compare_all(cases: list[list[tuple[float, float]]]) -> list[Comparison]:
    """REQUIRES: of each case pairs of old and new, none below 0."""
    return [compare([logarithm_of(old, new) for old, new in pairs], len(cases)) for pairs in cases]


def compare(logarithms: list[float], cases: int) -> Comparison:
    p = signed_rank_p(logarithms)
    ratio, low, high = map(math.exp, (statistics.median(walsh_averages(logarithms)), *interval(logarithms, cases)))
    return Comparison(ratio, low, high, p, min(1.0, cases * p), len(logarithms))


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


def build_version(root: pathlib.Path, revision: str, targets: tuple[str, ...] = ("tcphub",)) -> tuple[str, pathlib.Path]:
    """The commit, and the folder of its release build: a work tree under build/, which is kept for the next time."""
    commit = commit_of(root, revision)
    tree = root / "build" / "against" / commit[:12]
    if not (tree / "CMakeLists.txt").exists():
        tree.parent.mkdir(parents=True, exist_ok=True)
        # Forced twice: a tree that was deleted by hand is still known.
        run_loudly(["git", "-C", str(root), "worktree", "add", "--force", "--force", "--detach", str(tree), commit])
    # Without the tests other sources are compiled together, and the compiler warns of other things.
    parts = [f"-DGIMNET_{part}=OFF" for part in ("TESTS", "BENCH", "PERF", "WARNINGS_AS_ERRORS")]
    run_loudly(["cmake", "--preset", "release", *parts], cwd=tree)
    jobs = os.environ.get("GIMNET_JOBS", str(os.cpu_count() or 1))
    run_loudly(["cmake", "--build", "--preset", "release", "-j", jobs, "--target", *targets], cwd=tree)
    return commit, tree / "build" / "release"


@dataclass
class Measured:
    """What one case came to: `pairs` of old and new, unless it failed; and what was wrong with it."""

    case: Case
    pairs: list[tuple[float, float]] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    failed: bool = False


def measure_once(build: pathlib.Path, case: Case, settings: Settings) -> dict[str, float]:
    return run_with_tries(lambda: TcpHub(build, allowed_cpus()[:1], settings.hub_arguments), case, settings)


def measure_pairs(case: Case, other: pathlib.Path, count: int, settings: Settings) -> Measured:
    """A pair is both versions one after the other, the first of which changes from pair to pair. A run that fails twice ends this
    case, and no other."""
    versions = {"the other version": other, "this version": settings.build}
    sums: dict[str, dict[str, float]] = {name: {} for name in versions}
    measured = Measured(case)
    try:
        for number in range(count):
            found = {}
            for name in list(versions) if number % 2 == 0 else reversed(versions):
                findings = measure_once(versions[name], case, settings)
                found[name] = findings[case.spec.metric]
                for figure in COUNTED:
                    sums[name][figure] = sums[name].get(figure, 0) + abs(findings.get(figure, 0))
            measured.pairs.append(tuple(found[name] for name in versions))
    except SubjectError as error:
        measured.faults.append(Fault(True, f"{case}: {error}"))
        measured.failed = True
    for name, counted in sums.items():
        measured.faults += faults_of(f"{name}, {case}", counted)
    return measured


def describe(case: Case, comparison: Comparison) -> str:
    change, low, high = ((each - 1) * 100 for each in (comparison.ratio, comparison.low, comparison.high))
    confidence = f", confidence {(1 - comparison.p_of_all) * 100:.1f} %" if comparison.is_shown else ""
    return (f"{str(case):32} {case.spec.metric:20} {change:+6.1f} %  (between {low:+.1f} and {high:+.1f} %)  "
            f"{comparison.verdict}{confidence}, {comparison.pairs} pairs")


def explain(comparisons: list[Comparison]) -> str:
    """What the brackets, the verdicts and the confidence say."""
    of_all = f" of all {len(comparisons)} cases" if len(comparisons) > 1 else ""
    text = (f"In {CONFIDENCE:.0%} of such comparisons the true changes{of_all} lie between what the brackets say (Wilcoxon's signed-rank test).\n"
            "'Faster' and 'slower': they leave 0 out. 'No difference shown': there may be one, no larger than they say.")
    is_shown = any(each.is_shown for each in comparisons)
    return text + (f"\nThe confidence is 1 - p of the test{of_all} together." if is_shown else "")


def require_comparable(root: pathlib.Path, revision: str, cases: list[Case], count: int | None) -> None:
    """What can be known before anything is built. Raises BuildError."""
    if not cases:
        raise BuildError("none of the scenarios asked for exists in that size and on that transport")
    least = pairs_min(len(cases))
    if count is not None and count < least:
        among = f"one of {len(cases)} cases" if len(cases) > 1 else "a case"
        raise BuildError(f"--runs {count}: so few pairs cannot show a difference in {among}; give at least {least}")
    commit_of(root, revision)


def compare_versions(root: pathlib.Path, revision: str, cases: list[Case], count: int | None, settings: Settings) -> dict:
    """The JSON document; `count` pairs of each case, None: as many as usual. Raises BuildError."""
    require_comparable(root, revision, cases, count)
    count = count or max(PAIRS, pairs_min(len(cases)))
    commit, other = build_version(root, revision)
    measured = []
    for case in cases:
        say(f"  {case}: {count} pairs")
        measured.append(measure_pairs(case, other, count, settings))
    faults = [fault for each in measured for fault in each.faults]
    for fault in faults:
        say(str(fault))
    cases = [each.case for each in measured if not each.failed]
    comparisons = compare_all([each.pairs for each in measured if not each.failed])
    if cases:
        say("\n".join([f"this version against {revision} ({commit[:12]}):", *map(describe, cases, comparisons), explain(comparisons)]))
    return {"against": revision, "commit": commit, "confidence_of_all": CONFIDENCE, "faults": [str(each) for each in faults],
            "is_good": not any(fault.is_error for fault in faults) and all(each.verdict != "slower" for each in comparisons),
            "comparisons": [
        {"scenario": case.scenario, "size": case.size, "transport": case.transport, "metric": case.spec.metric,
         "ratio": each.ratio, "low": each.low, "high": each.high, "p": each.p, "p_of_all": each.p_of_all,
         "confidence": 1 - each.p_of_all, "pairs": each.pairs, "verdict": each.verdict}
        for case, each in zip(cases, comparisons)]}
