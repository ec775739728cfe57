"""Is one of two versions faster? From pairs of measurements that were made one right after the other."""

import math
import random
import statistics
from dataclasses import dataclass

CONFIDENCE = 0.95
RESAMPLES = 2000
# Fewer pairs cannot reach that confidence, whatever they say.
PAIRS_MIN = 6


@dataclass(frozen=True)
class Comparison:
    """`ratio` is new to old, of a figure of which less is better."""

    ratio: float
    low: float  # 95 % of resampled medians lie between low and high
    high: float
    confidence: float  # that there is a difference at all: 1 - p of Wilcoxon's signed-rank test
    pairs: int

    @property
    def verdict(self) -> str:
        if self.confidence < CONFIDENCE or self.low <= 1 <= self.high:
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


def compare(old: list[float], new: list[float]) -> Comparison:
    """REQUIRES: as many of each, in pairs, all above 0."""
    logarithms = [math.log(b / a) for a, b in zip(old, new, strict=True)]
    chance = random.Random(len(logarithms))  # the same pairs give the same answer
    medians = sorted(statistics.median(chance.choices(logarithms, k=len(logarithms))) for _ in range(RESAMPLES))
    outside = int(RESAMPLES * (1 - CONFIDENCE) / 2)
    return Comparison(ratio=math.exp(statistics.median(logarithms)), low=math.exp(medians[outside]),
                      high=math.exp(medians[-1 - outside]), confidence=1 - signed_rank_p(logarithms),
                      pairs=len(logarithms))
