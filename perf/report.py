#!/usr/bin/env python3
"""Writes docs/performance.md and its pictures from a JSON document of `./dev perf --json`: perf/report.py RESULT.json [DOCUMENT.md]"""

import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from driver.report import write_report  # noqa: E402

DOCUMENT = pathlib.Path(__file__).resolve().parent.parent / "docs" / "performance.md"


def main() -> int:
    if not 2 <= len(sys.argv) <= 3:
        print(__doc__, file=sys.stderr)
        return 2
    result = json.loads(pathlib.Path(sys.argv[1]).read_text())
    if any("rounds" not in row for row in result["results"]):
        print(f"{sys.argv[1]} does not hold the runs of each row: measure anew with ./dev perf --json", file=sys.stderr)
        return 1
    target = pathlib.Path(sys.argv[2]) if len(sys.argv) == 3 else DOCUMENT
    write_report(result, target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
