"""What the hub shall reach, as bounds on rows of the result: `bound` must hold, `goal` is where it is to get."""

from dataclasses import dataclass


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

    def holds(self, value: float, limit: float) -> bool:
        return value >= limit if self.at_least else value <= limit


NULL = "ratio_to_null"
NULL_TCP = "ratio_to_null_tcp"

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
    Goal("stalled_subscriber", 1024, "tcp", "rate_kept", None, 0.95, at_least=True),
    Goal("idle_10000", 16, "tcp", "rss_bytes_per_connection", 2048, 1024),
    Goal("connect_10000", 16, "tcp", "seconds_over_null", None, 0.5),
)

FIELD_TITLES = {
    NULL: "times the null relay",
    NULL_TCP: "times the null relay on TCP",
    "rate_kept": "of the healthy subscriber's rate kept",
    "rss_bytes_per_connection": "resident bytes a connection",
    "seconds_over_null": "seconds longer than the null relay",
}
