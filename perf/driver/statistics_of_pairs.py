"""Is one of two versions faster? From pairs of measurements that were made one right after the other."""

import math
import random
import statistics
from dataclasses import dataclass

# Of all cases of one comparison together: were there no difference anywhere, in so many of them none would be called one.
CONFIDENCE = 0.95
RESAMPLES = 10_000
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
    low: float  # between low and high lie the medians of resampled pairs, with CONFIDENCE for all cases together
    high: float
    p: float  # of Wilcoxon's signed-rank test, for this case alone
    p_of_all: float  # the same among all cases, by Holm
    pairs: int

    @property
    def confidence(self) -> float:
        """That there is a difference at all."""
        return 1 - self.p_of_all

    @property
    def verdict(self) -> str:
        if self.p_of_all > 1 - CONFIDENCE or self.low <= 1 <= self.high:
            return "no difference"
        return "faster" if self.ratio < 1 else "slower"


def signed_rank_p(differences: list[float]) -> float:
    """Two-sided p of Wilcoxon's signed-rank test, exact: equal sizes share their ranks, zeros are left out."""
    differences = [each for each in differences if each != 0]
    if not differences:
        return 1.0
    sizes = sorted(abs(each) for each in differences)
    # Twice the mean rank, so that shared ranks are whole numbers.
    rank = {size: 2 * sizes.index(size) + sizes.count(size) + 1 for size in sizes}
    ranks = [rank[abs(each)] for each in differences]
    total = sum(ranks)
    ways = [1] + [0] * total  # by sum: how many choices of signs give it
    for each in ranks:
        for sum_so_far in range(total, each - 1, -1):
            ways[sum_so_far] += ways[sum_so_far - each]
    positive = sum(each for each, difference in zip(ranks, differences) if difference > 0)
    tail = sum(ways[: min(positive, total - positive) + 1])
    return min(1.0, 2 * tail / 2 ** len(ranks))


def holm(ps: list[float]) -> list[float]:
    """What each p is worth where so many were looked at: Holm's method, so that looking often finds nothing by itself."""
    adjusted = [0.0] * len(ps)
    least = 0.0
    for rank, index in enumerate(sorted(range(len(ps)), key=ps.__getitem__)):
        least = max(least, min(1.0, (len(ps) - rank) * ps[index]))
        adjusted[index] = least
    return adjusted


def logarithms_of(pairs: list[tuple[float, float]]) -> list[float]:
    return [logarithm_of(old, new) for old, new in pairs]


def logarithm_of(old: float, new: float) -> float:
    if old == new:
        return 0.0  # both may be 0
    ratio = new / old if old > 0 else RATIO_MAX
    return math.log(min(max(ratio, 1 / RATIO_MAX), RATIO_MAX))


def interval(logarithms: list[float], cases: int) -> tuple[float, float]:
    """Of the median, from resampled pairs, widened for the number of cases by Bonferroni's method."""
    chance = random.Random(len(logarithms))  # the same pairs give the same answer
    medians = sorted(statistics.median(chance.choices(logarithms, k=len(logarithms))) for _ in range(RESAMPLES))
    outside = int(RESAMPLES * (1 - CONFIDENCE) / cases / 2)
    return math.exp(medians[outside]), math.exp(medians[-1 - outside])


def compare_all(cases: list[list[tuple[float, float]]]) -> list[Comparison]:
    """REQUIRES: of each case pairs of old and new, none below 0."""
    found = [logarithms_of(pairs) for pairs in cases]
    ps = [signed_rank_p(logarithms) for logarithms in found]
    return [Comparison(math.exp(statistics.median(logarithms)), *interval(logarithms, len(cases)), p, p_of_all, len(logarithms))
            for logarithms, p, p_of_all in zip(found, ps, holm(ps), strict=True)]
