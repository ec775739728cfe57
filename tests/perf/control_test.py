#!/usr/bin/env python3
"""What perf/driver/control.py reads out of the programs that it runs, and the paragraphs that it and python.py make of that."""

import pathlib
import unittest

import support  # noqa: F401
import report
from driver import control, network, python
from driver.subjects import SubjectError

FIGURES = {
    "date": "2026-01-01", "version": "0.1", "machine": {"processor": "a processor", "cpus_allowed": 2},
    "rejoin": [{"nodes": 10_000, "seconds": seconds} for seconds in (2.5, 1.5, 4.0)],
    "growth": {"resolve": {"1000": 100.0, "10000": 150.0, "100000": 250.0}, "only_small": {"1000": 7000.0}},
    "answers_ms": {"status": [3.0, 5.0, 4.0]},
}


class Control(unittest.TestCase):
    def test_reads_what_the_rejoin_test_prints(self):
        said = "[ RUN ] ...\n10000 nodes were back 3.21 s after kill -9\n[ OK ]\n"
        self.assertEqual(control.read_rejoin(said), {"nodes": 10_000, "seconds": 3.21})
        with self.assertRaisesRegex(SubjectError, "ulimit"):
            control.read_rejoin("[ SKIPPED ]\n")

    def test_what_it_looks_for_is_what_the_rejoin_test_prints(self):
        source = (pathlib.Path(__file__).resolve().parents[1] / "stress" / "rejoin_test.cpp").read_text()
        self.assertIn('"%zu nodes were back %.2f s after kill -9\\n"', source)

    def test_reads_the_growth_out_of_the_benchmark(self):
        rows = [{"name": "resolve/1000", "cpu_time": 100.0, "time_unit": "ns"},
                {"name": "list_page/all/1000", "cpu_time": 2.0, "time_unit": "us"},
                {"name": "list_page/all/100000", "cpu_time": 3.0, "time_unit": "ms"},
                {"name": "resolve/1000_stddev", "run_name": "resolve/1000", "aggregate_name": "stddev", "cpu_time": 9.0,
                 "time_unit": "ns"}]
        self.assertEqual(control.read_growth({"benchmarks": rows}),
                         {"resolve": {"1000": 100.0}, "list_page/all": {"1000": 2000.0, "100000": 3e6}})

    def test_the_paragraph_has_every_figure(self):
        text = " ".join(control.describe(FIGURES).split())
        for expected in ("2026-01-01, a processor, 2 processors, GIMnet 0.1.", "all 10,000 nodes are back in 2.5 s (1.5 to 4; goal 10 s)",
                         "takes 4 ms from start to end, at most 5 (goal 50 ms)", "names on the hub: resolve 0.1 to 0.25."):
            self.assertIn(expected, text)

    def test_so_has_that_of_python(self):
        figures = FIGURES | {"import_ms": 12.3, "messages_per_second": {
            "burst": {"gimnet": [60.0, 70.0, 90.0], "paho": [10.0, 10.0, 10.0], "pyzmq": [300.0, 140.0, 180.0]},
            "arrays": {"gimnet": [9.0, 8.0, 7.0], "pyzmq": [10.0, 8.0, 14.0]}}}
        text = " ".join(python.describe(figures).split())
        for expected in ("GIMnet 0.1. rate of 16 B, times paho-mqtt: 7 (goal 6, met)", "times pyzmq: 0.5 (goal 0.3, met)",
                         "rate of 1 MiB, times pyzmq: 0.9 (goal 1, missed)", "`import gimnet`: 12 ms of a processor more than `pass` (goal 50)",
                         "messages a second, 16 B: gimnet 70, paho 10, pyzmq 180; messages a second, 1 MiB: gimnet 8, pyzmq 10."):
            self.assertIn(expected, text)

    def test_a_page_gets_it_in_place_of_the_former_one(self):
        page = "# P\n\n<!-- control: written by ./dev perf -->\n\nold\n\n<!-- end of control -->\n\nmore\n"
        self.assertEqual(report.fill(page, "control", "new"), page.replace("old", "new"))


class NetworkPart(unittest.TestCase):
    def test_the_paragraph_has_every_figure_and_goal(self):
        figures = {name: [3.0, 1.0, 2.0] for name in network.GOALS}
        text = " ".join(network.describe(FIGURES | {"figures": figures}).split())
        self.assertEqual(text.count("2 (1 to 3; goal "), len(network.GOALS))
        for goal in network.GOALS.values():
            self.assertIn(f"; goal {network.shown(goal)})", text)


if __name__ == "__main__":
    unittest.main()
