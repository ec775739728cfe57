"""What the hub shall reach, as bounds on rows of the result: `bound` must hold, `goal` is where it is to get."""

from dataclasses import dataclass

from driver.figures import decisive


@dataclass(frozen=True)
class Goal:
    """A limit on one figure of the hub's row for a case."""

    scenario: str
    size: int
    transport: str
    field: str
    bound: float | None
    goal: float
    at_least: bool = False  # the figure shall not be below; otherwise not above
    subject: str = "tcphub"

    def holds(self, value: float, limit: float) -> bool:
        return value >= limit if self.at_least else value <= limit


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
    return f"bound met, {of_goal}" if kept else "bound undecided" if kept is None else "bound missed"


NULL = "ratio_to_null"
NULL_TCP = "ratio_to_null_tcp"
# Ends the name of a figure that compares with others over Unix sockets instead of TCP.
UNIX = "_unix"
# Another hub's cost in that of the row.
RIVAL_FIELDS = {"nats": "times_nats", "mosquitto": "times_mosquitto", "redis": "times_redis", "zeromq": "times_zeromq"}

GOALS = (
    Goal("one_to_one", 16, "tcp", NULL, 2.0, 1.25),
    Goal("one_to_one", 256, "tcp", NULL, None, 1.25),
    Goal("one_to_one", 4096, "tcp", NULL, None, 1.1),
    Goal("one_to_one", 65536, "tcp", NULL, 1.4, 1.2),
    Goal("one_to_one", 16, "unix", NULL_TCP, None, 0.85),
    Goal("one_to_one", 65536, "unix", NULL_TCP, None, 0.6),
    Goal("one_to_one_unbatched", 16, "unix", NULL_TCP, None, 0.33),
    Goal("in_turns", 16, "tcp", NULL, 4.0, 2.3),
    Goal("fan_out_10", 16, "tcp", NULL, None, 1.2),
    Goal("fan_out_100", 16, "tcp", NULL, 2.0, 1.2),
    Goal("fan_out_1000", 16, "tcp", NULL, None, 1.2),
    Goal("fan_out_1000", 1024, "tcp", NULL, None, 1.2),
    Goal("ping_one_cpu", 16, "tcp", NULL, 1.2, 1.0),
    Goal("one_to_one", 16, "tcp", RIVAL_FIELDS["nats"], None, 15, at_least=True),
    Goal("one_to_one", 16, "tcp", RIVAL_FIELDS["redis"], None, 35, at_least=True),
    Goal("one_to_one", 16, "tcp", RIVAL_FIELDS["zeromq"], None, 20, at_least=True),
    Goal("one_to_one", 65536, "tcp", RIVAL_FIELDS["nats"], None, 3, at_least=True),
    Goal("in_turns", 16, "tcp", RIVAL_FIELDS["nats"], None, 10, at_least=True),
    Goal("fan_out_10", 16, "tcp", RIVAL_FIELDS["nats"], None, 8, at_least=True),
    Goal("fan_out_100", 16, "tcp", RIVAL_FIELDS["nats"], None, 8, at_least=True),
    Goal("fan_out_1000", 16, "tcp", RIVAL_FIELDS["nats"], None, 8, at_least=True),
    Goal("ping_two_cpus", 16, "tcp", NULL, None, 0.35, subject="tcphub_spinning"),
    Goal("ping_paced", 16, "tcp", "p999_us", None, 250, subject="tcphub_spinning"),
    Goal("ping_under_bulk", 16, "tcp", "p99_over_idle", None, 1.5),
    Goal("ping_under_bulk", 16, "unix", "p99_over_idle", None, 1.5),
    Goal("stalled_subscriber", 1024, "tcp", "rate_kept", None, 0.95, at_least=True),
    # What the hub may hold at all (budget_bytes), and what may wait for one node (a lane and the reserve) with the buffers it lies in.
    Goal("stalled_subscriber", 1024, "tcp", "rss_growth_bytes", 256 << 20, 4 << 20),
    # A publisher that is blocked stands still as long as the stalled one does (0.75 s); one that is not, as long as the system lets it.
    Goal("stalled_subscriber", 1024, "tcp", "publisher_pause_ms", None, 100),
    Goal("idle_10000", 16, "tcp", "rss_bytes_per_connection", 1024, 1024),
    # No processor time beyond keep-alives: to the letter, what they would cost without a pause taken off; and by what each costs, times what it
    # does to a hub that has nothing but keep-alives to do.
    Goal("idle_10000", 16, "tcp", "cpu_share_beyond_keep_alives", None, 0),
    Goal("idle_10000", 16, "tcp", "keep_alive_over_busy", None, 1.25),
    Goal("idle_alone", 16, "tcp", "cpu_share", None, 0),
    Goal("idle_alone", 16, "tcp", "context_switches_per_second", None, 0),
    Goal("connect_10000", 16, "tcp", "seconds_over_null", None, 0.5),
    # Over a Unix socket a goal can be read either way: beside the others as they are mostly used, or as they are there.
    Goal("library_burst", 16, "tcp", "rate_over_best", None, 2, at_least=True),
    Goal("library_burst", 16, "unix", "rate_over_best", None, 2, at_least=True),
    Goal("library_burst", 16, "unix", "rate_over_best" + UNIX, None, 2, at_least=True),
    Goal("library_burst", 16, "tcp", "system_over_best", None, 0.5),
    Goal("library_burst", 16, "unix", "system_over_best", None, 0.5),
    Goal("library_burst", 16, "unix", "system_over_best" + UNIX, None, 0.5),
    Goal("library_round_trip", 16, "tcp", "rate_over_best", None, 1.1, at_least=True),
    Goal("library_round_trip", 16, "unix", "rate_over_best", None, 1.8, at_least=True),
    Goal("library_round_trip", 16, "unix", "rate_over_best" + UNIX, None, 1.8, at_least=True),
    Goal("library_round_trip_one_cpu", 16, "tcp", "rate_over_best", None, 1.1, at_least=True),
    Goal("library_round_trip_one_cpu", 16, "unix", "rate_over_best", None, 1.8, at_least=True),
    Goal("library_round_trip_one_cpu", 16, "unix", "rate_over_best" + UNIX, None, 1.8, at_least=True),
)


def rivals_in_goals(scenario: str, size: int, transport: str) -> set[str]:
    """The other hubs that a goal compares ours with in this case."""
    of_case = {goal.field for goal in GOALS if (goal.scenario, goal.size, goal.transport) == (scenario, size, transport)}
    return {rival for rival, field in RIVAL_FIELDS.items() if field in of_case}


FIELD_TITLES = {
    NULL: "times the null relay",
    NULL_TCP: "times the null relay on TCP",
    **{field: f"times cheaper than {name}" for name, field in RIVAL_FIELDS.items()},
    "p999_us": "99.9th percentile, us",
    "p99_over_idle": "99th percentile, times that of ping_two_cpus",
    "rate_kept": "of the healthy subscriber's rate kept",
    "rss_growth_bytes": "bytes grown by for the stalled one",
    "publisher_pause_ms": "the publisher's longest time without a write, ms",
    "rss_bytes_per_connection": "resident bytes a connection",
    "keep_alive_over_busy": "CPU of a keep-alive, times that of one among many at once",
    "cpu_share": "of a processor used",
    "cpu_share_beyond_keep_alives": "of a processor used beyond keep-alives",
    "context_switches_per_second": "context switches/s",
    "seconds_over_null": "seconds longer than the null relay",
    "rate_over_best": "messages/s, times the best other library on TCP",
    "system_over_best": "system CPU a message, times the best other library on TCP",
    "rate_over_best" + UNIX: "messages/s, times the best other library on a Unix socket",
    "system_over_best" + UNIX: "system CPU a message, times the best other library on a Unix socket",
}
