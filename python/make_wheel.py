#!/usr/bin/env python3
"""Makes a wheel of the package and of a libgimnet.so.1, for every Python 3 of a Linux that is new enough.

    make_wheel.py LIBRARY FOLDER      prints the path of the wheel"""

import base64
import hashlib
import pathlib
import platform
import re
import subprocess
import sys
import zipfile

PACKAGE = pathlib.Path(__file__).resolve().parent / "gimnet"
PROJECT = PACKAGE.parents[1] / "CMakeLists.txt"
TIMEOUT_S = 60
# Files of wheels have a time; one that never changes makes equal wheels of equal files.
EPOCH = (1980, 1, 1, 0, 0, 0)


def version():
    return re.search(r"project\(gimnet VERSION ([\d.]+)", PROJECT.read_text(encoding="utf-8"))[1]


def glibc_version(library):
    """The newest version of glibc that a symbol of the library asks for."""
    text = subprocess.run(["readelf", "--wide", "--version-info", library], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          text=True, timeout=TIMEOUT_S, check=True).stdout
    return max(tuple(int(part) for part in found.split(".")) for found in re.findall(r"GLIBC_(\d+\.\d+)", text))


def stripped(library, folder):
    copy = folder / "libgimnet.so.1"
    subprocess.run(["strip", "--strip-unneeded", "-o", copy, library], stdin=subprocess.DEVNULL, timeout=TIMEOUT_S, check=True)
    data = copy.read_bytes()
    copy.unlink()
    return data


def make_wheel(library, folder):
    major, minor = glibc_version(library)
    tag = f"py3-none-manylinux_{major}_{minor}_{platform.machine()}"
    name = f"gimnet-{version()}"
    info = f"{name}.dist-info"
    files = {f"gimnet/{path.name}": path.read_bytes() for path in sorted(PACKAGE.iterdir()) if path.is_file()}
    files["gimnet/libgimnet.so.1"] = stripped(library, folder)
    files[f"{info}/METADATA"] = (f"Metadata-Version: 2.1\nName: gimnet\nVersion: {version()}\nSummary: A network for robots\n"
                                 "License: Apache-2.0\nRequires-Python: >=3.9\n").encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: make_wheel\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    record = [f"{path},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b'=').decode()},{len(data)}"
              for path, data in files.items()]
    files[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,", ""]).encode()
    wheel = folder / f"{name}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(zipfile.ZipInfo(path, EPOCH), data, zipfile.ZIP_DEFLATED)
    return wheel


if __name__ == "__main__":
    target = pathlib.Path(sys.argv[2])
    target.mkdir(parents=True, exist_ok=True)
    print(make_wheel(sys.argv[1], target))
