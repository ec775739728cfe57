"""Which runs of a group are made again because those that there are say too little."""

from driver.goals import rivals_in_goals

# Runs that lie further apart come from more than one state of the machine or of the subject: three may all have met one.
APART_MAX = 1.5


def times_apart(values: list[float]) -> float:
    return max(values) / min(values) if values and min(values) > 0 else 1.0


def is_wild(outcome) -> bool:
    metric = outcome.case.spec.metric
    return outcome.error is None and times_apart([found[metric] for found in outcome.findings if metric in found]) > APART_MAX


def to_repeat(group: list) -> list:
    """The wild ones of a group of outcomes, in its order, with those that a verdict compares them with: the null relay, the
    hub where another one is wild, and the others that goals name where the hub is; of libraries, all."""
    wild = [outcome for outcome in group if is_wild(outcome)]
    needed = {id(outcome) for outcome in wild}
    for each in wild:
        case = each.case
        rivals = rivals_in_goals(case.scenario, case.size, case.transport) if each.subject == "tcphub" else set()
        for other in group:
            is_partner = (case.spec.roles is not None or other.subject == "null"
                          or (other.subject == each.subject and other.case.scenario == case.spec.beside)
                          or (other.case == case and (other.subject == "tcphub" or other.subject in rivals)))
            if is_partner and other.error is None:
                needed.add(id(other))
    return [outcome for outcome in group if id(outcome) in needed]
