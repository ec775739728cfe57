"""Which runs of a group are made again because those that there are say too little."""

from driver.figures import values_of
from driver.goals import GOALS, Goal, rivals_in_goals, standing
from driver.outcome import Outcome
from driver.summary import make_rows

# Runs that lie further apart come from more than one state of the machine or of the subject: three may all have met one.
APART_MAX = 1.5


def times_apart(values: list[float]) -> float:
    return max(values) / min(values) if values and min(values) > 0 else 1.0


def is_wild(outcome: Outcome) -> bool:
    metric = outcome.case.spec.metric
    return times_apart([found[metric] for found in outcome.findings if metric in found]) > APART_MAX


def decides_nothing(goal: Goal, row: dict) -> bool:
    values = values_of(row, goal.field)
    return bool(values) and None in (standing(goal, values, limit) for limit in (goal.goal, goal.bound) if limit is not None)


def find_undecided(group: list[Outcome]) -> list[Outcome]:
    """Those of a group with a bound or a goal that some of their runs meet and others do not."""
    doubtful = {(row["subject"], row["scenario"], row["size"], row["transport"]) for row in make_rows(group) for goal in GOALS
                if (goal.subject, goal.scenario, goal.size, goal.transport)
                == (row["subject"], row["scenario"], row["size"], row["transport"]) and decides_nothing(goal, row)}
    return [each for each in group if (each.subject, each.case.scenario, each.case.size, each.case.transport) in doubtful]


def to_repeat(group: list[Outcome], undecided: list[Outcome]) -> list[Outcome]:
    """The wild and the undecided ones of a group, in its order, with those that a verdict compares them with: the null relay, the
    hub where another one is wild, and the others that goals name where the hub is; of libraries, all."""
    doubtful = [outcome for outcome in group if outcome.error is None
                and (is_wild(outcome) or any(outcome is each for each in undecided))]
    return [outcome for outcome in group if outcome.error is None
            and any(outcome is each or is_partner(outcome, each) for each in doubtful)]


def is_partner(other: Outcome, doubtful: Outcome) -> bool:
    case = doubtful.case
    if case.spec.roles is not None or other.subject == "null":
        return True
    if other.subject == doubtful.subject and other.case.scenario == case.spec.beside:
        return True
    named = rivals_in_goals(case.scenario, case.size, case.transport) if doubtful.subject == "tcphub" else set()
    return other.case == case and (other.subject == "tcphub" or other.subject in named)
