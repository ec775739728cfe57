"""docs/performance.md and its pictures, from the JSON document of a run."""

import json
import pathlib
import subprocess
import sys
import tempfile

from driver.document import make_document
from driver.measure import say
from driver.plots import draw_all

# Debian's python3-matplotlib belongs to this one; the first in PATH may be another.
SYSTEM_PYTHON = pathlib.Path("/usr/bin/python3")
REPORT = pathlib.Path(__file__).resolve().parent.parent / "report.py"


def write_report(result: dict, document: pathlib.Path) -> None:
    folder = document.parent / document.stem
    try:
        pictures = draw_all(result["results"], folder)
    except ImportError:
        if write_by_system_python(result, document):
            return
        say("warning: no pictures: matplotlib is not installed (package python3-matplotlib)")
        pictures = []
    links = [f"![{title}]({folder.name}/{name})" for name, title in pictures]
    document.write_text(make_document(result, links))


def write_by_system_python(result: dict, document: pathlib.Path) -> bool:
    """Whether it could."""
    if not SYSTEM_PYTHON.exists() or SYSTEM_PYTHON.resolve() == pathlib.Path(sys.executable).resolve():
        return False
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(result, file)
        file.flush()
        command = [str(SYSTEM_PYTHON), str(REPORT), file.name, str(document)]
        return subprocess.run(command, stdin=subprocess.DEVNULL, timeout=300).returncode == 0
