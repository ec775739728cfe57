#!/usr/bin/env python3
"""The hex dumps of docs/protocol.md and docs/bitestream.md. The bytes and what is said of them are those of the golden vectors
(tests/vectors), which the libraries' tests write and read; the documents say before each dump, `FOLDER/NAME`, which one it is.

    dumps.py    writes the last section of docs/protocol.md and of docs/bitestream.md anew, after a vector was changed"""

import pathlib
import re
import struct
import textwrap
from dataclasses import dataclass

ROOT = pathlib.Path(__file__).resolve().parents[2]
VECTORS = ROOT / "tests" / "vectors"
PROTOCOL = ROOT / "docs" / "protocol.md"
BITESTREAM = ROOT / "docs" / "bitestream.md"
HEADER = 16
LINK, NS, CTRL, ROUTE, FLOW = 16, 17, 18, 19, 6

# What section 11 of the protocol shows, in this order.
FAMILIES = {"frame": "Data", "flow": "FLOW", "link": "LINK: connections", "gimi": "GIMI messages", "ns": "HubNS",
            "ctrl": "HubCtrl", "route": "ROUTE: records of hubs"}
SECTION = "## 11. Every frame in bytes\n"
# Long and deep ones stay in tests/vectors: nobody reads 300 times 78.
OF_BITESTREAM = ("example", "every_type", "length_fields")

_HEX = r"[0-9a-f]{2}(?: {1,2}[0-9a-f]{2})*"
_DUMP_LINE = re.compile(rf"^    ({_HEX})(?: {{3,}}\S.*)?$")
_NAME = re.compile(r"`([a-z]+/[a-z_0-9]+)`")


@dataclass(frozen=True)
class Line:
    """Bytes and what they mean."""
    data: bytes
    meaning: str


@dataclass(frozen=True)
class Vector:
    name: str
    title: str
    lines: tuple

    @property
    def data(self):
        return b"".join(line.data for line in self.lines)

    @property
    def order(self):
        """Opening first; then by kind, operation, the answer behind its request, name."""
        data = self.data
        if len(data) < HEADER:
            return (-1, 0, 0, self.name)
        kind, operation = data[12], 0
        if kind in (LINK, NS, CTRL, ROUTE):
            operation = struct.unpack_from("<H", data, HEADER)[0]
        elif kind == FLOW or self.name.startswith("gimi/"):
            operation = data[HEADER] if kind == FLOW else data[HEADER + 16]
        return (kind if not self.name.startswith("gimi/") else 0, operation & 0x7FFF, operation >> 15, self.name)


def vector(name):
    """The vector `FOLDER/NAME`. Bytes without a meaning belong to the line before them."""
    title, lines = "", []
    for text in (VECTORS / f"{name}.hex").read_text(encoding="utf-8").splitlines():
        digits, _, meaning = (part.strip() for part in text.partition("#"))
        if not digits:
            title = meaning
        elif meaning or not lines:
            lines.append(Line(bytes.fromhex(digits), meaning))
        else:
            lines[-1] = Line(lines[-1].data + bytes.fromhex(digits), lines[-1].meaning)
    return Vector(name, title, tuple(lines))


def vectors(folder):
    return sorted((vector(f"{folder}/{path.stem}") for path in (VECTORS / folder).glob("*.hex")), key=lambda v: v.order)


def _with_header_in_one_line(lines):
    sizes = [len(line.data) for line in lines[:4]]
    if sizes != [4, 4, 4, 4] or not lines[0].meaning.startswith("length"):
        return [(line.data.hex(" "), line.meaning) for line in lines]
    header = "  ".join(line.data.hex(" ") for line in lines[:4])
    return [(header, ", ".join(line.meaning for line in lines[:4]))] + [
        (line.data.hex(" "), line.meaning) for line in lines[4:]]


def rendered(shown):
    """A vector as a document has it."""
    rows = []
    for digits, meaning in _with_header_in_one_line(shown.lines):
        pieces = [digits[at:at + 48].rstrip() for at in range(0, len(digits), 48)] if "  " not in digits else [digits]
        rows += [(piece, meaning if at == 0 else "") for at, piece in enumerate(pieces)]
    width = max(len(digits) for digits, _ in rows) + 3
    body = "".join(f"    {digits:{width}}{meaning}".rstrip() + "\n" for digits, meaning in rows)
    title = "\n".join(textwrap.wrap(f"`{shown.name}` {shown.title}", 100, break_on_hyphens=False, break_long_words=False))
    return f"{title}\n\n{body}"


def section_of_protocol():
    parts = [SECTION, "\nFrom 7.17, or to it, wherever that is possible; a line is a field, or a value of\nBitestream. The dumps"
             " are those of `tests/vectors`, which have the same names.\n"]
    for folder, heading in FAMILIES.items():
        parts.append(f"\n### {heading}\n")
        parts += ["\n" + rendered(each) for each in vectors(folder)]
    return "".join(parts)


def section_of_bitestream():
    return "Examples:\n" + "".join("\n" + rendered(vector(f"bitestream/{name}")) for name in OF_BITESTREAM)


def dumps(page):
    """[(names of the vectors, bytes)]: of every indented block that begins with bytes."""
    found, names, data, in_paragraph = [], (), None, False
    for text in page.splitlines() + [""]:
        match = _DUMP_LINE.match(text)
        if match and data is not None:
            data += bytes.fromhex(match[1])
        elif match:
            data = bytes.fromhex(match[1])
        elif not text.startswith("    "):
            if data is not None:
                found.append((names, data))
                data, names = None, ()
            if text.strip():
                names = (names if in_paragraph else ()) + tuple(_NAME.findall(text))
        in_paragraph = bool(text.strip()) and not text.startswith("    ")
    return found


def _replace_tail(document, begin, tail):
    page = document.read_text(encoding="utf-8")
    document.write_text(page[:page.index(begin)] + tail, encoding="utf-8")


if __name__ == "__main__":
    _replace_tail(PROTOCOL, SECTION, section_of_protocol())
    _replace_tail(BITESTREAM, "Examples:\n", section_of_bitestream())
