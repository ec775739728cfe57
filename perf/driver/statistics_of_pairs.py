"""Is one of two versions faster? From pairs of measurements that were made one right after the other.

Everything is of Wilcoxon's signed-rank test, by way of the means of each two differences (Walsh averages): the sum of ranks
on one side is how many of these lie there. So the interval, the verdict and the confidence always say the same."""

import functools
import itertools
import math
import statistics
from dataclasses import dataclass

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
    def confidence(self) -> float:
        """That there is a difference at all."""
        return 1 - self.p_of_all

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


def logarithms_of(pairs: list[tuple[float, float]]) -> list[float]:
    return [logarithm_of(old, new) for old, new in pairs]


def logarithm_of(old: float, new: float) -> float:
    if old == new:
        return 0.0  # both may be 0
    ratio = new / old if old > 0 else RATIO_MAX
    return math.log(min(max(ratio, 1 / RATIO_MAX), RATIO_MAX))


def compare_all(cases: list[list[tuple[float, float]]]) -> list[Comparison]:
    """REQUIRES: of each case pairs of old and new, none below 0."""
    return [compare(logarithms_of(pairs), len(cases)) for pairs in cases]


def compare(logarithms: list[float], cases: int) -> Comparison:
    p = signed_rank_p(logarithms)
    ratio, low, high = map(math.exp, (statistics.median(walsh_averages(logarithms)), *interval(logarithms, cases)))
    return Comparison(ratio, low, high, p, min(1.0, cases * p), len(logarithms))
