"""The scenarios, what each is compared with, what the hub shall reach in them, and which make up a quick, a whole and a smoke run."""

from dataclasses import dataclass

SIZES = (16, 256, 1024, 4096, 65536, 1048576)
TRANSPORTS = ("tcp", "unix")
CPU = "cpu_ns_per_message"


@dataclass(frozen=True)
class Scenario:
    """How a scenario is run and judged. The generator (perf/generator/scenario.cpp) knows what it does."""

    relay_mode: str | None = "pair"  # how the null relay runs its baseline; None: there is nothing to compare with
    baseline: str | None = None  # the null relay's scenario where it is another one
    metric: str = CPU  # the figure whose ratio, minimum and maximum are reported: less is better
    one_cpu: bool = False  # generator on the subject's processor
    sizes: tuple[int, ...] = (16,)
    unix_sizes: tuple[int, ...] = (16,)  # over Unix sockets; none: not measured there
    seconds_factor: float = 1  # measured longer than others
    beside: str | None = None  # takes turns also with this scenario, since their figures are compared
    roles: tuple[str, str] | None = None  # of two programs that talk by means of a library, the answering one first

    def sizes_over(self, transport: str) -> tuple[int, ...]:
        return self.sizes if transport == "tcp" else self.unix_sizes


# Other hubs, each measured by its own library, and a library without a hub.
BROKERS = ("nats", "mosquitto")
RIVALS = (*BROKERS, "cyclonedds")
WITH_LIBRARY = ("tcphub", *RIVALS)

SCENARIOS = {
    "one_to_one": Scenario(sizes=SIZES, unix_sizes=(16, 4096, 65536)),
    "one_to_one_unbatched": Scenario(sizes=SIZES[:4]),
    "four_to_four": Scenario(sizes=(16, 1024, 4096, 65536)),
    "in_turns": Scenario(baseline="one_to_one", sizes=SIZES),
    "fan_out_10": Scenario(relay_mode="fan_out", sizes=SIZES),
    "fan_out_100": Scenario(relay_mode="fan_out", sizes=SIZES[:5]),
    "fan_out_1000": Scenario(relay_mode="fan_out", sizes=(16, 1024)),
    "list_100": Scenario(relay_mode="fan_out", baseline="fan_out_100", sizes=(16, 1024)),
    "ping_one_cpu": Scenario(metric="p50_us", one_cpu=True),
    "ping_two_cpus": Scenario(metric="p50_us"),
    "ping_paced": Scenario(metric="p50_us", seconds_factor=4),
    "ping_under_bulk": Scenario(metric="p99_us", beside="ping_two_cpus"),
    # Four phases, alone and beside a stalled one in turns.
    "stalled_subscriber": Scenario(relay_mode=None, sizes=(1024,), unix_sizes=(), seconds_factor=6),
    # Several rounds of keep-alives, one of which is said each 0.9 s.
    "idle_10000": Scenario(relay_mode=None, metric="rss_bytes_per_connection", unix_sizes=(), seconds_factor=8),
    "idle_alone": Scenario(relay_mode=None, metric="context_switches_per_second", unix_sizes=(), seconds_factor=6),
    "connect_10000": Scenario(metric="seconds", unix_sizes=()),
    # Longer, as the system's share of the time is only looked at at each tick of the kernel, 100 to 1,000 times a second.
    "library_burst": Scenario(relay_mode=None, roles=("receiver", "sender"), sizes=(16, 1024, 65536, 1048576),
                              unix_sizes=(16, 1024, 65536, 1048576), seconds_factor=2),
    "library_round_trip": Scenario(relay_mode=None, metric="p50_us", roles=("echo", "pinger"), seconds_factor=2),
    "library_round_trip_one_cpu": Scenario(relay_mode=None, metric="p50_us", one_cpu=True, roles=("echo", "pinger"),
                                           seconds_factor=2),
    "library_request": Scenario(relay_mode=None, metric="p50_us", roles=("answerer", "asker"), seconds_factor=2),
}


# Where a shard that polls instead of sleeping makes a difference.
OF_SPINNING = frozenset({"one_to_one", "one_to_one_unbatched", "ping_one_cpu", "ping_two_cpus", "ping_paced", "ping_under_bulk"})


@dataclass(frozen=True)
class Case:
    """One line of the table."""

    scenario: str
    size: int
    transport: str

    @property
    def spec(self) -> Scenario:
        return SCENARIOS[self.scenario]

    @property
    def baseline(self) -> "Case | None":
        """What the null relay is asked to do for comparison."""
        if self.spec.relay_mode is None:
            return None
        return Case(self.spec.baseline or self.scenario, self.size, self.transport)

    @property
    def group(self) -> "Case":
        """Cases of one group take turns: those that are compared with each other, over a Unix socket with TCP too."""
        return Case(self.spec.beside or self.spec.baseline or self.scenario, self.size, "tcp")

    def among(self, subjects: tuple[str, ...]) -> tuple[str, ...]:
        """Those of the subjects that it is about."""
        return tuple(name for name in subjects if (name in WITH_LIBRARY if self.spec.roles else name not in RIVALS))

    def __str__(self) -> str:
        return f"{self.scenario} {self.size} B {self.transport}"


def whole_cases() -> list[Case]:
    return [Case(name, size, transport) for name, spec in SCENARIOS.items() for transport in TRANSPORTS
            for size in spec.sizes_over(transport)]


# Which subjects a case is measured on.
Plan = dict[Case, tuple[str, ...]]


def plan_of(cases: list[Case], subjects: tuple[str, ...]) -> Plan:
    """Every subject in every case; of the hub's variants what they are for."""
    def among(case: Case, name: str) -> bool:
        if name == "tcphub_spinning":
            return case.scenario in OF_SPINNING and case.size == 16
        if name == "tcphub_2_shards":
            return case.transport == "tcp" and case.size in (case.spec.sizes[0], 65536)
        return True

    return {case: tuple(name for name in case.among(subjects) if among(case, name)) for case in cases}


def whole_plan(subjects: tuple[str, ...]) -> Plan:
    return plan_of(whole_cases(), subjects)


def quick_plan(subjects: tuple[str, ...]) -> Plan:
    """The cases that goals are set for."""
    return plan_of(quick_cases(), subjects)


def quick_cases() -> list[Case]:
    over_tcp = [("one_to_one", 16), ("one_to_one", 256), ("one_to_one", 4096), ("one_to_one", 65536),
                ("one_to_one_unbatched", 16), ("four_to_four", 16), ("in_turns", 16), ("fan_out_10", 16),
                ("fan_out_100", 16), ("fan_out_1000", 16), ("fan_out_1000", 1024), ("list_100", 16),
                ("ping_one_cpu", 16), ("ping_two_cpus", 16), ("ping_paced", 16),
                ("ping_under_bulk", 16),
                ("stalled_subscriber", 1024), ("idle_10000", 16), ("idle_alone", 16), ("connect_10000", 16)]
    over_unix = [("one_to_one", 16), ("one_to_one", 65536), ("one_to_one_unbatched", 16), ("ping_one_cpu", 16), ("ping_two_cpus", 16),
                 ("ping_under_bulk", 16)]
    return [Case(*case, "tcp") for case in over_tcp] + [Case(*case, "unix") for case in over_unix]


def smoke_cases() -> list[Case]:
    """Every scenario once, the basic ones in every size class and on both transports."""
    cases = [Case(name, spec.sizes[0], "tcp") for name, spec in SCENARIOS.items()]
    cases += [Case("one_to_one", size, transport) for size in (4096, 65536) for transport in TRANSPORTS]
    cases += [Case("in_turns", 65536, "tcp"), Case("fan_out_10", 65536, "unix"), Case("ping_one_cpu", 16, "unix"),
              Case("library_burst", 16, "unix"), Case("library_round_trip", 16, "unix")]
    return cases


# What a whole run measures longer than its scenario's factor says, at least so many seconds, and of whom.
# ping_paced: the 99.9th percentile of 20 s at 1 kHz is the 20th longest round trip; of 2 s, it was the second longest.
# library_burst: kernels that account time by ticks say of each process only at 250 ticks a second or so whose a tick was; two programs and
# a hub that are in the system for a fifth of their time or less are met there 250 times in 5 s, which is 6 % of it either way.
WHOLE_SECONDS = {
    Case("ping_paced", 16, "tcp"): (20, ("null", "tcphub", "tcphub_spinning")),
    Case("library_burst", 16, "tcp"): (5, WITH_LIBRARY),
    Case("library_burst", 16, "unix"): (5, WITH_LIBRARY),
}


def whole_seconds(seconds: float, subject: str, case: Case) -> float:
    """How long a whole run of `seconds` measures it."""
    least, subjects = WHOLE_SECONDS.get(case, (0, ()))
    usual = seconds * case.spec.seconds_factor
    return max(usual, least) if subject in subjects else usual


SMOKE_SECONDS = 1
SMOKE_MOMENT_SECONDS = 0.1
# In a smoke run nothing is compared: the null relay is run in each of its modes, so that it cannot rot, and the other
# subjects in what they do differently.
SMOKE_OF_NULL = frozenset({Case("one_to_one", 16, "tcp"), Case("fan_out_10", 16, "tcp"), Case("ping_one_cpu", 16, "tcp")})
SMOKE_OF_OTHERS = frozenset({Case("one_to_one", 16, "tcp"), Case("one_to_one", 65536, "unix"),
                             Case("fan_out_10", 16, "tcp"), Case("ping_one_cpu", 16, "tcp")})


def smoke_plan(subjects: tuple[str, ...]) -> Plan:
    def among(case: Case, name: str) -> bool:
        if name == "tcphub_spinning" and case.spec.one_cpu:
            return False  # it would take the generator's time
        return name in WITH_LIBRARY or case in (SMOKE_OF_NULL if name == "null" else SMOKE_OF_OTHERS)

    return {case: tuple(name for name in case.among(subjects) if among(case, name)) for case in smoke_cases()}


def smoke_seconds(subject: str, case: Case) -> float:
    """Every scenario of the hub for a second, over TCP in its first size; what is left of a smoke run for a moment, so that
    all of it takes a minute."""
    is_first = case == Case(case.scenario, case.spec.sizes[0], "tcp")
    return SMOKE_SECONDS if subject == "tcphub" and is_first else SMOKE_MOMENT_SECONDS


def chosen_plan(scenarios: list[str], sizes: list[int], transports: list[str], subjects: tuple[str, ...]) -> Plan:
    """The scenarios asked for, in the sizes asked for, which may be others than usual."""
    cases = [Case(name, size, transport) for name in scenarios or SCENARIOS
             for transport in TRANSPORTS if not transports or transport in transports
             for size in SCENARIOS[name].sizes_over(transport) and (sizes or SCENARIOS[name].sizes_over(transport))]
    return {case: case.among(subjects) for case in cases}


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


# From so many runs on the smallest and the largest are left out: in nine, the median of all that there could be lies
# between the second and the eighth with 96 % probability, while the two outermost are whatever the machine did then.
RUNS_TO_TRIM = 9


def decisive(values: list[float]) -> tuple[float, float]:
    """Between which two values what is measured is taken to lie. REQUIRES: at least one."""
    ordered = sorted(values)
    return (ordered[1], ordered[-2]) if len(ordered) >= RUNS_TO_TRIM else (ordered[0], ordered[-1])


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
    Goal("library_burst", 16, "tcp", "cpu_over_best", None, 0.5),
    Goal("library_burst", 16, "tcp", "cpu_over_dds", None, 0.25),
    Goal("library_burst", 1024, "tcp", "cpu_over_dds", None, 0.5),
    Goal("library_burst", 65536, "tcp", "cpu_over_dds", None, 1),
    Goal("library_burst", 1048576, "tcp", "cpu_over_dds", None, 1),
    Goal("library_burst", 65536, "unix", "rate_over_tcp", None, 1.3, at_least=True),
    Goal("library_burst", 1048576, "unix", "rate_over_tcp", None, 1.3, at_least=True),
    Goal("library_round_trip", 16, "tcp", "rate_over_best", None, 1.1, at_least=True),
    Goal("library_round_trip", 16, "unix", "rate_over_best", None, 1.8, at_least=True),
    Goal("library_round_trip", 16, "unix", "rate_over_best" + UNIX, None, 1.8, at_least=True),
    Goal("library_round_trip_one_cpu", 16, "tcp", "rate_over_best", None, 1.1, at_least=True),
    Goal("library_round_trip_one_cpu", 16, "unix", "rate_over_best", None, 1.8, at_least=True),
    Goal("library_round_trip_one_cpu", 16, "unix", "rate_over_best" + UNIX, None, 1.8, at_least=True),
    Goal("library_request", 16, "tcp", "request_over_plain", None, 1.2),
    Goal("library_request", 16, "unix", "request_over_plain", None, 1.2),
)


FIELD_TITLES = {
    NULL: "times the null relay",
    NULL_TCP: "times the null relay on TCP",
    "p999_us": "99.9th percentile, us",
    "p99_over_idle": "99th percentile, times that of ping_two_cpus",
    "rate_kept": "of the healthy subscriber's rate kept",
    "rss_growth_bytes": "bytes grown by for the stalled one",
    "publisher_pause_ms": "the publisher's longest time without a write, ms",
    "rss_bytes_per_connection": "resident bytes a connection",
    "cpu_share": "of a processor used",
    "context_switches_per_second": "context switches/s",
    "seconds_over_null": "seconds longer than the null relay",
    "request_over_plain": "times a plain round trip of the same run",
    "rate_over_best": "messages/s, times the best other library on TCP",
    "cpu_over_best": "CPU a message, times the best other library on TCP",
    "cpu_over_dds": "CPU a message, times Cyclone DDS",
    "rate_over_tcp": "messages/s, times its own on TCP",
    "system_over_best": "system CPU a message, times the best other library on TCP",
    "rate_over_best" + UNIX: "messages/s, times the best other library on a Unix socket",
    "system_over_best" + UNIX: "system CPU a message, times the best other library on a Unix socket",
}
