#!/usr/bin/env python3
"""What perf/driver/control.py reads out of the programs that it runs, and the section that it makes of that."""

import json
import pathlib
import tempfile
import unittest

from support import result_of
from driver import control
from driver.document import make_document
from driver.subjects import SubjectError

FIGURES = {
    "date": "2026-01-01", "version": "0.1", "machine": {"processor": "a processor", "cpus_allowed": 2},
    "rejoin": [{"nodes": 10_000, "seconds": seconds} for seconds in (2.5, 1.5, 4.0)],
    "growth": {"resolve": {"1000": 100.0, "10000": 150.0, "100000": 250.0}, "only_small": {"1000": 7000.0}},
    "answers_ms": {"status": [3.0, 5.0, 4.0]},
}
JOINS = {"scenario": "ping_beside_joins", "subject": "tcphub", "p50_us": 12, "p50_us_alone": 11, "p99_us": 40, "p99_us_alone": 30}


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

    def test_the_section_has_every_figure(self):
        section = control.make_section(FIGURES)
        self.assertTrue(section.startswith(control.SECTION + "\n"))
        for expected in ("2.5 s (1.5 to 4)", "10,000 nodes", "| resolve | 0.1 | 0.15 | 0.25 | 2.5 |",
                         "| only_small | 7 |  |  |  |", "| gimnet status | 4 | 5 |"):
            self.assertIn(expected, section)

    def test_bystanders_have_a_section_where_they_were_measured(self):
        self.assertEqual(control.bystanders_lines([]), [])
        self.assertIn("| tcphub | 11 | 12 | 30 | 40 |", "\n".join(control.bystanders_lines([JOINS])))

    def test_a_page_gets_the_section_in_place_of_its_own_or_where_it_belongs(self):
        section = control.make_section(FIGURES)
        page = "# Performance\n\n## Findings\n\nmany\n\n## All figures\n\n| 1 |\n"
        once = control.put_into(page, section)
        self.assertEqual(once, page.replace("\n## All", f"\n{section}\n## All"))
        self.assertEqual(control.put_into(once, section), once)
        other = control.make_section(FIGURES | {"version": "0.2"})
        self.assertEqual(control.put_into(control.put_into(once, other), section), once)

    def test_the_document_has_the_section_where_it_was_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            kept = pathlib.Path(folder, "control.json")
            self.assertEqual(control.section_lines(kept), [])
            kept.write_text(json.dumps(FIGURES))
            self.assertEqual(control.section_lines(kept), [control.make_section(FIGURES)])
            before, control.FIGURES = control.FIGURES, kept
            try:
                page = make_document(result_of([]))
                self.assertEqual(control.put_into(page, control.make_section(FIGURES)), page)
            finally:
                control.FIGURES = before


if __name__ == "__main__":
    unittest.main()
