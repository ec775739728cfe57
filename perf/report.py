#!/usr/bin/env python3
"""Fills a page such as docs/performance.md from a JSON document of `./dev perf --json`, and writes its plots and full tables (JSON) into
the folder of the page's name beside it. A page that does not exist begins as a copy of docs/performance.md:

    perf/report.py RESULT.json PAGE.md
"""

import json
import pathlib
import re
import sys
import textwrap

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from driver.rows import shown, values_of  # noqa: E402
from driver.suite import CPU, FIELD_TITLES, GOALS, SCENARIOS, Case, verdict  # noqa: E402

PAGE = pathlib.Path(__file__).resolve().parent.parent / "docs" / "performance.md"
METRIC_TITLES = {CPU: "CPU, ns a message", "p50_us": "round trip, us", "p99_us": "99th percentile, us", "seconds": "seconds",
                 "rss_bytes_per_connection": "bytes a connection", "context_switches_per_second": "context switches/s"}
COLOURS = {"null": "#888888", "tcphub": "#1f77b4", "tcphub_2_shards": "#17becf", "tcphub_spinning": "#9467bd",
           "nats": "#2ca02c", "mosquitto": "#8c564b", "cyclonedds": "#e377c2", "redis": "#d62728", "zeromq": "#ff7f0e"}
PERCENTILES = (("p10_us", 0.1), ("p25_us", 0.25), ("p50_us", 0.5), ("p75_us", 0.75), ("p90_us", 0.9), ("p99_us", 0.99),
               ("p999_us", 0.999), ("max_us", 0.9999))


def figure(row: dict, name: str) -> list[float]:
    """Median, smallest and largest."""
    return [row[name], *row["spread"][name]]


def judge_goals(rows: list[dict]) -> list[dict]:
    measured = {(row["subject"], row["scenario"], row["size"], row["transport"]): row for row in rows}
    judged = []
    for goal in GOALS:
        row = measured.get((goal.subject, goal.scenario, goal.size, goal.transport), {"rounds": []})
        if values := values_of(row, goal.field):
            judged.append({"subject": goal.subject, "scenario": goal.scenario, "size": goal.size, "transport": goal.transport,
                           "figure": goal.field, "title": FIELD_TITLES[goal.field], "bound": goal.bound, "goal": goal.goal, "at_least": goal.at_least,
                           "runs": len(values), "measured": figure(row, goal.field), "verdict": verdict(goal, values)})
    return judged


def make_record(result: dict) -> dict:
    """The full tables: of each row medians with the smallest and the largest, and what became of each goal."""
    rows = [{name: row[name] for name in ("subject", "scenario", "size", "transport", "runs")} | {"lost": row.get("lost", 0)}
            | {"figures": {name: figure(row, name) for name in row["spread"]}} for row in result["results"]]
    rest = {name: value for name, value in result.items() if name != "results"}
    return rest | {"goals": judge_goals(result["results"]), "results": rows}


def record_text(record: dict) -> str:
    """A line for each row, so that two records can be compared."""
    parts = []
    for name, value in record.items():
        is_table = isinstance(value, list) and value and isinstance(value[0], dict)
        text = "[\n" + ",\n".join("  " + json.dumps(each) for each in value) + "\n ]" if is_table else json.dumps(value)
        parts.append(f" {json.dumps(name)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def where_and_when(record: dict) -> str:
    machine = record["machine"]
    versions = "".join(f"; {name} {version}" for name, version in record.get("versions", {}).items())
    text = (f"{record['date']}; {machine['processor']}, {machine['cpus_allowed']} processors, {machine['system']}, Linux {machine['kernel']}; "
            f"GIMnet {record.get('version', '')}{versions}; {record['runs']} runs of {record['seconds']} s "
            f"(of some scenarios longer); further arguments of the hub: {' '.join(record['hub_arguments']) or 'none'}.")
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)


def goal_text(goal: dict) -> str:
    of = "" if goal["subject"] == "tcphub" else goal["subject"].removeprefix("tcphub_") + ": "
    return f"{of}{goal['title']}: {shown(goal['measured'][0])} ({'>=' if goal['at_least'] else '<='} {shown(goal['goal'])}), {goal['verdict']}"


def make_table(record: dict) -> str:
    """A line for each case that has a goal."""
    goals: dict[Case, list[str]] = {}
    for goal in record["goals"]:
        goals.setdefault(Case(goal["scenario"], goal["size"], goal["transport"]), []).append(goal_text(goal))
    subjects = [name for name in COLOURS if any(row["subject"] == name for row in record["results"]) and not name.startswith("tcphub_")]
    lines = [["scenario", "bytes", "over", "figure", *subjects, "goals"], ["---"] * (5 + len(subjects))]
    for case, texts in goals.items():
        metric = SCENARIOS[case.scenario].metric
        found = {row["subject"]: row["figures"] for row in record["results"]
                 if (row["scenario"], row["size"], row["transport"]) == (case.scenario, case.size, case.transport)}
        lines.append([case.scenario, f"{case.size:,}", case.transport, METRIC_TITLES[metric],
                      *(shown(found.get(name, {}).get(metric, [None])[0]) for name in subjects), "; ".join(texts)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def fill(page: str, mark: str, text: str) -> str:
    """The page with `text` between its two comments `mark`."""
    begin, end = f"<!-- {mark}: written by ./dev perf -->", f"<!-- end of {mark} -->"
    before, _, rest = page.partition(begin)
    return f"{before}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}"


def series_of_cost(rows: list[dict], place_of) -> dict[str, list[tuple[float, float]]]:
    """Subject: (place, ns a message), over TCP. `place_of` says where on the axis a row stands; None: nowhere."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if (place := place_of(row)) is not None and row["transport"] == "tcp" and CPU in row["figures"]:
            found.setdefault(row["subject"], []).append((place, row["figures"][CPU][0]))
    return {name: sorted(points) for name, points in found.items()}


def place_by_size(row: dict) -> int | None:
    return row["size"] if row["scenario"] == "one_to_one" else None


def place_by_subscribers(row: dict) -> int | None:
    return {"one_to_one": 1, "fan_out_10": 10, "fan_out_100": 100, "fan_out_1000": 1000}.get(row["scenario"]) if row["size"] == 16 else None


def series_of_latency(rows: list[dict], scenario: str) -> dict[str, list[tuple[float, float]]]:
    """Subject: (round trip in us, share of round trips that take longer), over TCP."""
    return {row["subject"]: [(row["figures"][key][0], 1 - share) for key, share in PERCENTILES if key in row["figures"]]
            for row in rows if row["scenario"] == scenario and row["transport"] == "tcp"}


def draw(path: pathlib.Path, titles: tuple[str, str, str], series: dict, base: int) -> None:
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    drawing, axes = pyplot.subplots(figsize=(7, 4.5))
    for name, points in series.items():
        axes.plot(*zip(*points), marker="o", markersize=3, label=name, color=COLOURS.get(name), linewidth=2 if name == "tcphub" else 1)
    axes.set(xscale="log", yscale="log", xlabel=titles[1], ylabel=titles[2])
    axes.set_xscale("log", base=base)
    axes.set_title(titles[0], fontsize=10)
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(fontsize=8)
    drawing.tight_layout()
    # Without the date and version that matplotlib would write: the same figures give the same file.
    drawing.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(drawing)


def draw_all(rows: list[dict], folder: pathlib.Path) -> list[str]:
    """Draws what the rows are enough for; the names of the files. Raises ImportError without matplotlib."""
    import matplotlib  # noqa: F401

    cost = "hub CPU, ns per delivered message"
    wanted = {"cost_by_size": (("One to one over TCP: cost against size", "payload, bytes", cost), series_of_cost(rows, place_by_size), 2),
              "cost_by_subscribers": (("16 bytes over TCP: cost against number of subscribers", "subscribers", cost),
                                      series_of_cost(rows, place_by_subscribers), 10),
              "latency_ping_one_cpu": (("ping_one_cpu: round trips over TCP", "round trip, us", "share that takes longer"),
                                       series_of_latency(rows, "ping_one_cpu"), 10)}
    drawn = {f"{name}.png": parts for name, parts in wanted.items() if any(len(points) > 1 for points in parts[1].values())}
    for name, parts in drawn.items():
        draw(folder / name, *parts)
    return list(drawn)


def write_report(result: dict, page: pathlib.Path) -> None:
    folder = page.parent / page.stem
    record = make_record(result)
    text = fill((page if page.exists() else PAGE).read_text(), "figures", f"{where_and_when(record)}\n\n{make_table(record)}")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        draw_all(record["results"], folder)
    except ImportError:
        print(f"warning: no plots: {sys.executable} has no matplotlib (package python3-matplotlib)", file=sys.stderr)
    (folder / "figures.json").write_text(record_text(record))
    page.write_text(re.sub(r"\]\(\w+/(\w+\.(?:png|json))\)", rf"]({folder.name}/\1)", text))


def main() -> int:
    if "--help" in sys.argv or "-h" in sys.argv:
        print(__doc__.strip())
        return 0
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    try:
        write_report(json.loads(pathlib.Path(sys.argv[1]).read_text()), pathlib.Path(sys.argv[2]))
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        print(f"{sys.argv[1]} is no result of ./dev perf --json: {type(error).__name__} {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
