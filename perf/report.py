#!/usr/bin/env python3
"""Writes a page such as docs/performance.md, and its pictures, from a JSON document of `./dev perf --json`:

    perf/report.py RESULT.json DOCUMENT.md
"""

import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

from driver.report import write_report  # noqa: E402

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
    if "--help" in sys.argv or "-h" in sys.argv:
        print(__doc__.strip())
        return 0
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    try:
        write_report(read_result(sys.argv[1]), pathlib.Path(sys.argv[2]))
    except ResultError as error:
        print(error, file=sys.stderr)
        return 1
    except (KeyError, TypeError, AttributeError) as error:
        print(f"{sys.argv[1]} is not a whole result of ./dev perf --json: {type(error).__name__} {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
