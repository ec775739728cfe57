"""Whether bounds and goals are met: the verdicts of docs/performance.md."""

from driver.figures import decisive, shown, shown_spread, values_of
from driver.goals import FIELD_TITLES, GOALS, Goal
from driver.markdown import table

EXPLANATION = """A bound must hold; a goal is where the hub is to get, and never weaker than the bound. `measured` is the median of the runs; of a figure that compares two
subjects, the median of what the rounds gave in which both were measured. The verdict is of all runs, not of the median; where there are nine or more, the smallest
and the largest do not count for it. A limit is met where all runs hold it, missed where none does, and undecided where some do and others do not.

- `goal met`: all runs hold the goal, and with it the bound if there is one.
- `goal missed`: no run holds it; `goal undecided`: some do.
- `bound met, goal missed` and `bound met, goal undecided`: the same, where there is a bound, which all runs hold.
- `bound missed`: no run holds the bound, and so none the goal; `bound undecided`: some hold the bound, and not all the goal.
- `not measured`: this result has no such row."""


def standing(goal: Goal, values: list[float], limit: float) -> bool | None:
    """Does it hold? None: its runs do not agree."""
    held = {goal.holds(value, limit) for value in decisive(values)}
    return held.pop() if len(held) == 1 else None


def verdict(goal: Goal, values: list[float]) -> str:
    reached = standing(goal, values, goal.goal)
    if reached:
        return "goal met"
    of_goal = "goal undecided" if reached is None else "goal missed"
    if goal.bound is None:
        return of_goal
    kept = standing(goal, values, goal.bound)
    return f"bound met, {of_goal}" if kept else "**bound undecided**" if kept is None else "**bound missed**"


def goal_line(goal: Goal, row: dict | None) -> list[str]:
    values = values_of(row, goal.field) if row is not None else []
    sign = ">=" if goal.at_least else "<="
    what = [goal.subject, goal.scenario, str(goal.size), goal.transport, FIELD_TITLES[goal.field],
            f"{sign} {shown(goal.bound)}" if goal.bound is not None else "", f"{sign} {shown(goal.goal)}"]
    if not values:
        return [*what, "not measured", "", "", ""]
    return [*what, shown(row[goal.field]), shown_spread(row, goal.field), str(len(values)), verdict(goal, values)]


def goal_table(rows: list[dict]) -> str:
    measured = {(row["subject"], row["scenario"], row["size"], row["transport"]): row for row in rows}
    lines = [goal_line(goal, measured.get((goal.subject, goal.scenario, goal.size, goal.transport))) for goal in GOALS]
    return table(["subject", "scenario", "bytes", "transport", "figure", "bound", "goal", "measured", "runs from to", "runs", ""],
                 lines)
