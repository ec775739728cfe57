"""Recorded runs of real robots, in the CARMEN format. Where they are says GIMNET_ROBOT_LOGS, else ../shared/data/robot-logs
beside this checkout; without them a small log is made up."""

import gzip
import math
import os
import pathlib
import sys

from support.processes import ROOT


def _folder():
    named = os.environ.get("GIMNET_ROBOT_LOGS")
    candidates = [pathlib.Path(named)] if named else [ROOT.parent / "shared" / "data" / "robot-logs"]
    return next((path for path in candidates if path.is_dir()), None)


def _made_up(lines):
    for number in range(lines):
        angle = number / 50.0
        stamp = f"{number / 10:.6f} robot {number / 10:.6f}"
        if number % 2:
            yield f"ODOM {math.cos(angle):.6f} {math.sin(angle):.6f} {angle:.6f} 0.3 0.1 0.0 {stamp}"
        else:
            ranges = " ".join(f"{2 + math.sin(angle + beam / 20):.2f}" for beam in range(180))
            yield f"FLASER 180 {ranges} {math.cos(angle):.6f} {math.sin(angle):.6f} {angle:.6f} 0 0 0 {stamp}"


def _with_newline(data):
    return data if data.endswith(b"\n") else data + b"\n"


def robot_logs():
    """The bytes of each log that there is: whole lines, newline at the end."""
    folder = _folder()
    logs = sorted(folder.glob("*.log.gz")) if folder else []
    if not logs:
        print("no robot log found (GIMNET_ROBOT_LOGS names a folder): a made-up one is used", file=sys.stderr)
        return ["".join(line + "\n" for line in _made_up(3000)).encode()]
    return [_with_newline(gzip.decompress(log.read_bytes()).replace(b"\r", b"")) for log in logs]
