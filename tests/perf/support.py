"""What the tests of perf/driver share: results without the programs that they are of."""

import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "perf"))

from driver import suite  # noqa: E402
from driver.measure import Outcome  # noqa: E402


def outcome(subject: str, case: suite.Case, costs: list[float], lost: int = 0, **more: float) -> Outcome:
    """One run for each of `costs`, which are of the figure that decides."""
    return Outcome(subject, case, [{case.spec.metric: cost, "lost": lost, "wrong": 0} | more for cost in costs])


def result_of(rows: list[dict]) -> dict:
    """What `./dev perf --json` would print of them."""
    return {"results": rows, "machine": {"processor": "p", "cpus_allowed": 2, "system": "s", "kernel": "k"}, "date": "d",
            "version": "v", "seconds": 1, "runs": 3, "hub_arguments": []}
