"""What the null relay costs on this machine, beside another one that is known: so that a reader sees what the machine is."""

from driver.figures import shown, shown_spread
from driver.markdown import table
from driver.suite import CPU

MACHINE = "an AMD Zen 4 machine with 2 virtual processors, 2026"
EXPLANATION = f"""A relay that does nothing costs what the machine's processor, kernel and hypervisor make of it. Beside it is what the same relay took on
{MACHINE}: figures of this page that are times in themselves, not ratios, are to be read with that."""
US = 1000
# The null relay there, in us.
ELSEWHERE = tuple((scenario, size, "tcp", name, us) for scenario, size, name, us in (
    ("one_to_one", 16, CPU, 0.011), ("one_to_one", 256, CPU, 0.080), ("one_to_one", 4096, CPU, 1.3), ("one_to_one", 65536, CPU, 24),
    ("one_to_one_unbatched", 16, CPU, 4.1), ("four_to_four", 16, CPU, 0.009), ("fan_out_10", 16, CPU, 0.007),
    ("fan_out_1000", 16, CPU, 0.021), ("fan_out_1000", 1024, CPU, 0.69), ("ping_one_cpu", 16, "p50_us", 32.7),
    ("ping_paced", 16, "p50_us", 152), ("ping_paced", 16, "p999_us", 1223), ("ping_under_bulk", 16, "p50_us", 223),
    ("ping_under_bulk", 16, "p99_us", 674), ("ping_under_300MBps", 16, "p50_us", 125), ("ping_under_300MBps", 16, "p99_us", 239),
    ("ping_two_cpus", 16, "p50_us", 144.5),  # 136 to 153
)) + tuple((scenario, 16, "unix", name, us) for scenario, name, us in (
    ("ping_one_cpu", "p50_us", 23.5), ("ping_two_cpus", "p50_us", 104), ("ping_paced", "p50_us", 147), ("ping_paced", "p999_us", 3099),
    ("ping_under_bulk", "p50_us", 103), ("ping_under_bulk", "p99_us", 284), ("ping_under_300MBps", "p50_us", 99),
    ("ping_under_300MBps", "p99_us", 192),
))
TITLES = {CPU: "CPU, us a message", "p50_us": "round trip, us, median", "p99_us": "round trip, us, 99th percentile",
          "p999_us": "round trip, us, 99.9th percentile"}


def in_us(row: dict, name: str) -> dict:
    """The row with this figure in us, spread and all."""
    if name != CPU:
        return row
    spread = [each / US for each in row["spread"][name]]
    return row | {name: row[name] / US, "spread": row["spread"] | {name: spread}}


def yardstick_table(rows: list[dict]) -> str:
    """Nothing where the null relay was not measured."""
    of_null = {(row["scenario"], row["size"], row["transport"]): row for row in rows if row["subject"] == "null"}
    lines = []
    for scenario, size, transport, name, elsewhere in ELSEWHERE:
        row = of_null.get((scenario, size, transport))
        if row is None or row.get(name) is None:
            continue
        here = in_us(row, name)
        lines.append([scenario, str(size), transport, TITLES[name], shown(here[name]), shown_spread(here, name), shown(elsewhere),
                      shown(here[name] / elsewhere)])
    if not lines:
        return ""
    return table(["null relay", "bytes", "transport", "figure", "here", "runs from to", "there", "here, times there"], lines)
