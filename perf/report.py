#!/usr/bin/env python3
"""Writes docs/performance.md and its pictures from a JSON document of `./dev perf --json`: perf/report.py RESULT.json [DOCUMENT.md]"""

import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from driver.report import write_report  # noqa: E402

DOCUMENT = pathlib.Path(__file__).resolve().parent.parent / "docs" / "performance.md"
# Without these there is no page; what else there may be, it can do without.
NEEDED = ("results", "machine", "date", "seconds", "runs", "runs_max", "hub_arguments")


class ResultError(Exception):
    """A file is no result of which a page can be made: one sentence, with its name."""


def read_result(path: str) -> dict:
    """Raises ResultError."""
    try:
        result = json.loads(pathlib.Path(path).read_text())
    except OSError as error:
        raise ResultError(f"{path} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ResultError(f"{path} is not JSON ({error}): give what ./dev perf --json printed") from None
    missing = [name for name in NEEDED if not isinstance(result, dict) or name not in result]
    if missing:
        raise ResultError(f"{path} is not a result of ./dev perf --json: it has no {', '.join(missing)}")
    rows = result["results"]
    if not isinstance(rows, list) or any(not isinstance(row, dict) or "rounds" not in row for row in rows):
        raise ResultError(f"{path} does not hold the runs of each row: measure anew with ./dev perf --json")
    return result


def main() -> int:
    if not 2 <= len(sys.argv) <= 3:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        result = read_result(sys.argv[1])
    except ResultError as error:
        print(error, file=sys.stderr)
        return 1
    target = pathlib.Path(sys.argv[2]) if len(sys.argv) == 3 else DOCUMENT
    write_report(result, target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
