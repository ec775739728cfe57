#!/usr/bin/env python3
"""The table of limits in docs/operations.md says what `tcphub --help-limits` says."""

import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def documented_limits():
    text = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
    rows = {}
    for line in text[text.index("## Limits"):].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 5 and cells[1].isdigit():
            rows[cells[0]] = cells[1:]
    return rows


def limits_in_force(tcphub):
    text = subprocess.run([tcphub, "--help-limits"], check=True, capture_output=True, text=True, timeout=20).stdout
    rows = {}
    for match in re.finditer(r"^  (\S+) +(\d+) (\S+) +(.*) \((\d+) to (\d+)\)$", text, re.MULTILINE):
        name, default, unit, reason, least, most = match.groups()
        rows[name] = [default, unit, f"{least} to {most}", reason]
    return rows


class Operations(unittest.TestCase):
    tcphub = ""

    def test_documents_every_limit(self):
        in_force = limits_in_force(self.tcphub)
        self.assertGreater(len(in_force), 20)
        self.assertEqual(documented_limits(), in_force)


if __name__ == "__main__":
    Operations.tcphub = sys.argv.pop()
    unittest.main()
