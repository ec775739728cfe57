"""The scenarios, what each is compared with, and which of them make up a quick, a whole and a smoke run."""

from dataclasses import dataclass

from driver.goals import rivals_in_goals

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


# Hubs whose own library is measured with them.
WITH_LIBRARY = ("tcphub", "nats", "mosquitto")

SCENARIOS = {
    "one_to_one": Scenario(sizes=SIZES, unix_sizes=(16, 4096, 65536)),
    "one_to_one_unbatched": Scenario(sizes=SIZES[:4]),
    "four_to_four": Scenario(sizes=(16, 1024, 4096, 65536)),
    "in_turns": Scenario(baseline="one_to_one", sizes=SIZES),
    "fan_out_10": Scenario(relay_mode="fan_out", sizes=SIZES),
    "fan_out_100": Scenario(relay_mode="fan_out", sizes=SIZES[:5]),
    "fan_out_1000": Scenario(relay_mode="fan_out", sizes=(16, 1024)),
    "list_100": Scenario(relay_mode="fan_out", baseline="fan_out_100", sizes=(16, 1024)),
    "broadcast_100": Scenario(relay_mode="fan_out", baseline="fan_out_100", sizes=(16, 1024)),
    "ping_one_cpu": Scenario(metric="p50_us", one_cpu=True),
    "ping_two_cpus": Scenario(metric="p50_us"),
    "ping_paced": Scenario(metric="p50_us", seconds_factor=4),
    "ping_under_bulk": Scenario(metric="p99_us", beside="ping_two_cpus"),
    "ping_under_300MBps": Scenario(metric="p99_us", beside="ping_two_cpus"),
    # Four phases, alone and beside a stalled one in turns.
    "stalled_subscriber": Scenario(relay_mode=None, sizes=(1024,), unix_sizes=(), seconds_factor=6),
    # Several rounds of keep-alives, one of which is said each 0.9 s.
    "idle_10000": Scenario(relay_mode=None, metric="rss_bytes_per_connection", unix_sizes=(), seconds_factor=8),
    "idle_alone": Scenario(relay_mode=None, metric="context_switches_per_second", unix_sizes=(), seconds_factor=6),
    "connect_10000": Scenario(metric="seconds", unix_sizes=()),
    "join_under_load": Scenario(metric="seconds", unix_sizes=()),
    "ping_beside_joins": Scenario(metric="p99_us", unix_sizes=()),
    # Longer, as the system's share of the time is only looked at at each tick of the kernel, 100 to 1,000 times a second.
    "library_burst": Scenario(relay_mode=None, roles=("receiver", "sender"), sizes=(16, 1024), unix_sizes=(16, 1024),
                              seconds_factor=2),
    "library_round_trip": Scenario(relay_mode=None, metric="p50_us", roles=("echo", "pinger"), seconds_factor=2),
    "library_round_trip_one_cpu": Scenario(relay_mode=None, metric="p50_us", one_cpu=True, roles=("echo", "pinger"),
                                           seconds_factor=2),
}


# Where a shard that polls instead of sleeping makes a difference.
OF_SPINNING = frozenset({"one_to_one", "one_to_one_unbatched", "ping_one_cpu", "ping_two_cpus", "ping_paced", "ping_under_bulk",
                         "ping_under_300MBps"})


# Where all messages go between two.
OF_TWO = frozenset({"one_to_one", "one_to_one_unbatched", "ping_one_cpu", "ping_two_cpus", "ping_paced"})


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
        return tuple(name for name in subjects if self.spec.roles is None or name in WITH_LIBRARY)

    def __str__(self) -> str:
        return f"{self.scenario} {self.size} B {self.transport}"


def whole_cases() -> list[Case]:
    return [Case(name, size, transport) for name, spec in SCENARIOS.items() for transport in TRANSPORTS
            for size in spec.sizes_over(transport)]


# Which subjects a case is measured on.
Plan = dict[Case, tuple[str, ...]]
OURS = ("null", "tcphub")


def whole_plan(subjects: tuple[str, ...]) -> Plan:
    """Every subject in every case; of the hub's variants what they are for, and of the others over Unix sockets what goes
    between two."""
    def among(case: Case, name: str) -> bool:
        if name == "tcphub_spinning":
            return case.scenario in OF_SPINNING and case.size == 16
        if name == "tcphub_2_shards":
            return case.transport == "tcp" and case.size in (case.spec.sizes[0], 65536)
        return case.transport == "tcp" or name in OURS or case.spec.roles is not None or case.scenario in OF_TWO

    return {case: tuple(name for name in case.among(subjects) if among(case, name)) for case in whole_cases()}


# What every subject is measured in, also in a quick run.
QUICK_OF_ALL = frozenset({Case("one_to_one", 16, "tcp"), Case("one_to_one", 65536, "tcp"), Case("in_turns", 16, "tcp"),
                          Case("fan_out_100", 16, "tcp")})
# Where spinning is for.
QUICK_OF_SPINNING = frozenset({Case("ping_two_cpus", 16, "tcp"), Case("ping_paced", 16, "tcp")})


def quick_plan(subjects: tuple[str, ...]) -> Plan:
    """All subjects in the cases that compare them; ours in those that goals are set for, with the others that these name."""
    def among(case: Case, name: str) -> bool:
        return (name in OURS or case in QUICK_OF_ALL or (name == "tcphub_spinning" and case in QUICK_OF_SPINNING)
                or name in rivals_in_goals(case.scenario, case.size, case.transport))

    return {case: tuple(name for name in subjects if among(case, name)) for case in quick_cases()}


def quick_cases() -> list[Case]:
    over_tcp = [("one_to_one", 16), ("one_to_one", 256), ("one_to_one", 4096), ("one_to_one", 65536),
                ("one_to_one_unbatched", 16), ("four_to_four", 16), ("in_turns", 16), ("fan_out_10", 16),
                ("fan_out_100", 16), ("fan_out_1000", 16), ("fan_out_1000", 1024), ("list_100", 16),
                ("broadcast_100", 16), ("ping_one_cpu", 16), ("ping_two_cpus", 16), ("ping_paced", 16),
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
        if case.spec.roles is not None:
            return name in WITH_LIBRARY
        return name == "tcphub" or case in (SMOKE_OF_NULL if name == "null" else SMOKE_OF_OTHERS)

    return {case: tuple(name for name in subjects if among(case, name)) for case in smoke_cases()}


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
