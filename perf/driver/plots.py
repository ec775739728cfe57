"""The pictures of docs/performance.md, from the rows of a result. Needs matplotlib (package python3-matplotlib)."""

import pathlib

COLOURS = {"null": "#888888", "tcphub": "#1f77b4", "tcphub_2_shards": "#17becf", "tcphub_spinning": "#9467bd",
           "nats": "#2ca02c", "mosquitto": "#8c564b", "redis": "#d62728", "zeromq": "#ff7f0e"}
PERCENTILES = (("p10_us", 0.1), ("p25_us", 0.25), ("p50_us", 0.5), ("p75_us", 0.75), ("p90_us", 0.9), ("p99_us", 0.99),
               ("p999_us", 0.999), ("max_us", 0.9999))


def series_by_size(rows: list[dict], scenario: str) -> dict[str, list[tuple[float, float]]]:
    """Subject: (payload bytes, ns a message), over TCP."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row["scenario"] == scenario and row["transport"] == "tcp" and row["cpu_ns_per_message"]:
            found.setdefault(row["subject"], []).append((row["size"], row["cpu_ns_per_message"]))
    return {name: sorted(points) for name, points in found.items()}


def series_by_subscribers(rows: list[dict], size: int) -> dict[str, list[tuple[float, float]]]:
    """Subject: (subscribers, ns a delivered message), over TCP; one_to_one is one subscriber."""
    subscribers = {"one_to_one": 1, "fan_out_10": 10, "fan_out_100": 100, "fan_out_1000": 1000}
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        count = subscribers.get(row["scenario"])
        if count and row["size"] == size and row["transport"] == "tcp" and row["cpu_ns_per_message"]:
            found.setdefault(row["subject"], []).append((count, row["cpu_ns_per_message"]))
    return {name: sorted(points) for name, points in found.items()}


def series_of_latency(rows: list[dict], scenario: str) -> dict[str, list[tuple[float, float]]]:
    """Subject: (round trip in us, share of round trips that take longer), over TCP."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row["scenario"] == scenario and row["transport"] == "tcp":
            points = [(row[key], 1 - share) for key, share in PERCENTILES if row.get(key)]
            if points:
                found[row["subject"]] = points
    return found


def draw(path: pathlib.Path, title: str, axes_titles: tuple[str, str], series: dict, base: int = 10) -> None:
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7, 4.5))
    for name, points in series.items():
        axes.plot([x for x, _ in points], [y for _, y in points], marker="o", markersize=3, label=name,
                  color=COLOURS.get(name), linewidth=2 if name == "tcphub" else 1)
    axes.set_xscale("log", base=base)
    axes.set_yscale("log")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(axes_titles[0])
    axes.set_ylabel(axes_titles[1])
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(fontsize=8)
    figure.tight_layout()
    # Without the date and version that matplotlib would write: the same figures give the same file.
    figure.savefig(path, dpi=110, metadata={"Software": None})
    pyplot.close(figure)


def draw_all(rows: list[dict], folder: pathlib.Path) -> list[tuple[str, str]]:
    """Writes what the rows are enough for; file names and titles. Raises ImportError without matplotlib."""
    import matplotlib  # noqa: F401

    cost = "hub CPU, ns per delivered message"
    wanted = [("cost_by_size", "One to one over TCP: cost against size", ("payload, bytes", cost),
               series_by_size(rows, "one_to_one"), 2),
              ("cost_by_size_in_turns", "In turns to 8 nodes over TCP: cost against size", ("payload, bytes", cost),
               series_by_size(rows, "in_turns"), 2),
              ("cost_by_subscribers", "16 bytes over TCP: cost against number of subscribers", ("subscribers", cost),
               series_by_subscribers(rows, 16), 10)]
    wanted += [(f"latency_{name}", f"{name}: round trips over TCP", ("round trip, us", "share that takes longer"),
                series_of_latency(rows, name), 10) for name in ("ping_one_cpu", "ping_two_cpus", "ping_paced",
                                                                "ping_under_bulk", "ping_under_300MBps",
                                                                "library_round_trip", "library_round_trip_one_cpu")]
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    for name, title, axes_titles, series, base in wanted:
        path = folder / f"{name}.png"
        path.unlink(missing_ok=True)
        if any(len(points) > 1 for points in series.values()):
            draw(path, title, axes_titles, series, base)
            drawn.append((path.name, title))
    return drawn
