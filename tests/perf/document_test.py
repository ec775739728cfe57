#!/usr/bin/env python3
"""The table, the plots and the full tables that perf/report.py makes of a result."""

import contextlib
import io
import json
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

from support import ROOT, outcome, result_of
import report
from driver import control, network, suite
from driver.rows import Outcome, make_rows
from driver.suite import FIELD_TITLES, GOALS


def standing_text(rows: list[dict], scenario: str) -> list[str]:
    """What the table says of each goal of this scenario."""
    lines = [line for line in report.make_table(report.make_record(result_of(rows))).splitlines() if f"| {scenario} |" in line]
    return [text for line in lines for text in line.strip("| ").split(" | ")[-1].split("; ")]


class Table(unittest.TestCase):
    ONE_TO_ONE = suite.Case("one_to_one", 16, "tcp")

    def test_shows_each_subject_and_what_became_of_each_goal(self):
        rows = make_rows([outcome("null", self.ONE_TO_ONE, [10, 10, 10]), outcome("tcphub", self.ONE_TO_ONE, [15, 14, 16]),
                          outcome("tcphub_2_shards", self.ONE_TO_ONE, [1, 1, 1])])
        lines = report.make_table(report.make_record(result_of(rows))).splitlines()
        self.assertEqual(lines[0], "| scenario | bytes | over | figure | null | tcphub | goals |")
        self.assertEqual(lines[2], "| one_to_one | 16 | tcp | CPU, ns a message | 10 | 15 | "
                                   "times the null relay: 1.5 (<= 1.25), bound met, goal missed |")
        self.assertEqual(len(lines), 3, "what was not measured has no line")

    def test_every_figure_that_decides_has_a_title(self):
        for goal in GOALS:
            self.assertIn(suite.SCENARIOS[goal.scenario].metric, report.METRIC_TITLES)
            self.assertIn(goal.field, FIELD_TITLES)

    def test_a_library_on_a_unix_socket_is_judged_beside_others_on_either_transport(self):
        def runs(subject, transport, rate):
            return Outcome(subject, suite.Case("library_burst", 16, transport),
                           [{"messages_per_second": rate, "cpu_ns_per_message": 1, "system_ns_per_message": 1}])
        rows = make_rows([runs("tcphub", "unix", 5e6), runs("mosquitto", "tcp", 2e6), runs("mosquitto", "unix", 4e6)])
        texts = [text for text in standing_text(rows, "library_burst") if text.startswith("messages/s")]
        self.assertEqual(texts, ["messages/s, times the best other library on TCP: 2.5 (>= 2), goal met",
                                 "messages/s, times the best other library on a Unix socket: 1.25 (>= 2), goal missed"])

    def test_a_stalled_subscriber_is_judged_by_rate_memory_and_the_publisher(self):
        case = suite.Case("stalled_subscriber", 1024, "tcp")
        hub = Outcome("tcphub", case, [{"cpu_ns_per_message": 1, "rate_kept": kept, "rss_growth_bytes": 3 << 20, "publisher_pause_ms": 700}
                                       for kept in (0.94, 0.97)])
        self.assertEqual([text.rpartition(", ")[2] for text in standing_text(make_rows([hub]), "stalled_subscriber")],
                         ["goal undecided", "goal met", "goal missed"])

    def test_an_idle_hub_is_to_do_nothing_at_all(self):
        case = suite.Case("idle_alone", 16, "tcp")
        for switches, expected in ((0, "goal met"), (2, "goal missed")):
            hub = Outcome("tcphub", case, [{"context_switches_per_second": switches, "cpu_share": 0}] * 3)
            self.assertEqual([text.rpartition(", ")[2] for text in standing_text(make_rows([hub]), "idle_alone")], ["goal met", expected])


class Record(unittest.TestCase):
    CASE = suite.Case("ping_paced", 16, "tcp")

    def test_has_the_median_the_smallest_and_the_largest_of_every_figure(self):
        record = report.make_record(result_of(make_rows([outcome("tcphub", self.CASE, [1, 3, 2], lost=1)])))
        (row,) = record["results"]
        self.assertEqual((row["figures"]["p50_us"], row["lost"], row["runs"]), ([2, 1, 3], 3, 3))
        self.assertEqual(record["machine"], result_of([])["machine"])

    def test_has_what_became_of_each_goal_that_was_measured(self):
        rows = make_rows([outcome("tcphub_spinning", self.CASE, [1, 1], p999_us=200)])
        (goal,) = report.make_record(result_of(rows))["goals"]
        self.assertEqual((goal["figure"], goal["measured"], goal["verdict"]), ("p999_us", [200, 200, 200], "goal met"))

    def test_what_is_kept_is_a_record_and_the_page_is_made_of_it(self):
        text = (ROOT / "docs" / "performance" / "figures.json").read_text()
        record, page = json.loads(text), report.PAGE.read_text()
        self.assertEqual(report.record_text(record), text)
        self.assertEqual(report.fill(page, "figures", f"{report.where_and_when(record)}\n\n{report.make_table(record)}"), page)
        for part in (control, network):
            if part.FIGURES.exists():
                self.assertEqual(report.fill(page, part.FIGURES.stem, part.describe(json.loads(part.FIGURES.read_text()))), page)

    def test_every_verdict_is_explained_on_the_page(self):
        for word in ("goal", "bound", "met", "missed", "undecided"):
            self.assertIn(word, report.PAGE.read_text().partition("<!-- figures")[0].partition("## The figures")[2])


class Report(unittest.TestCase):
    """perf/report.py as it is called."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def report(self, text: str | bytes | None):
        """The exit status and what was said, of a file with this in it."""
        path = self.folder / "result.json"
        if text is not None:
            path.write_bytes(text if isinstance(text, bytes) else text.encode())
        said = io.StringIO()
        with contextlib.redirect_stderr(said), mock.patch.object(sys, "argv", ["report.py", str(path), str(self.folder / "page.md")]), \
                mock.patch.object(report, "draw_all", lambda rows, folder: []):
            return report.main(), said.getvalue().replace(str(self.folder), "")

    def test_what_is_no_result_is_named_in_one_sentence(self):
        good = result_of([])
        for text, sentence in ((None, "/result.json: No such file or directory"), ("{", "/result.json is no result of ./dev perf --json: "),
                               (b"\xff\xfe", "is no result"), ("", "is no result"), ("[]", "is no result"), ('{"rejoin": []}', "KeyError 'results'"),
                               (json.dumps({name: value for name, value in good.items() if name != "date"}), "KeyError 'date'"),
                               (json.dumps(good | {"results": [{"subject": "null"}]}), "KeyError"),
                               (json.dumps(good | {"machine": {}}), "KeyError"), (json.dumps(good | {"results": [1]}), "TypeError"),
                               (json.dumps(good | {"results": 1}), "TypeError")):
            status, said = self.report(text)
            self.assertEqual((status, said.count("\n")), (1, 1), said)
            self.assertIn(sentence, said)
            self.assertFalse((self.folder / "page.md").exists())

    def test_a_result_becomes_the_page_that_is_named(self):
        self.assertEqual(self.report(json.dumps(result_of(make_rows([outcome("tcphub", suite.Case("in_turns", 16, "tcp"), [7])])))), (0, ""))
        page = (self.folder / "page.md").read_text()
        self.assertTrue(page.startswith("# Performance"))
        self.assertIn("\nd; p, 2 processors, s, Linux k; GIMnet v; 3 runs of 1 s", page)
        self.assertIn("](page/cost_by_size.png)", page)
        self.assertEqual(json.loads((self.folder / "page" / "figures.json").read_text())["results"][0]["figures"], {"cpu_ns_per_message": [7, 7, 7]})


class Plots(unittest.TestCase):
    ROWS = [{"subject": "tcphub", "scenario": scenario, "transport": transport, "size": size, "figures": {"cpu_ns_per_message": [cost]}}
            for scenario, transport, size, cost in (("one_to_one", "tcp", 256, 80), ("one_to_one", "tcp", 16, 12),
                                                    ("one_to_one", "unix", 16, 9), ("fan_out_10", "tcp", 16, 7))]

    def test_lines_are_of_one_scenario_over_tcp_in_order(self):
        self.assertEqual(report.series_of_cost(self.ROWS, report.place_by_size), {"tcphub": [(16, 12), (256, 80)]})
        self.assertEqual(report.series_of_cost(self.ROWS, report.place_by_subscribers), {"tcphub": [(1, 12), (10, 7)]})

    def test_latency_is_the_share_that_takes_longer(self):
        rows = [{"subject": "null", "scenario": "ping_paced", "transport": "tcp", "figures": {"p50_us": [30], "p99_us": [90]}}]
        (points,) = report.series_of_latency(rows, "ping_paced").values()
        self.assertEqual([(x, round(y, 9)) for x, y in points], [(30, 0.5), (90, 0.01)])

    def test_draws_what_there_are_rows_for(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("matplotlib is not installed")
        with tempfile.TemporaryDirectory() as folder:
            drawn = report.draw_all(self.ROWS, pathlib.Path(folder))
            self.assertEqual(drawn, ["cost_by_size.png", "cost_by_subscribers.png"])
            for name in drawn:
                self.assertTrue(pathlib.Path(folder, name).read_bytes().startswith(b"\x89PNG"))


if __name__ == "__main__":
    unittest.main()
