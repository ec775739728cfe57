#!/usr/bin/env python3
"""The programs that README and tutorial show, as they stand there.

    documents.py FOLDER    writes those in C++ and C into FOLDER/readme, FOLDER/cpp and FOLDER/c, for the build"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[3]
TUTORIAL = ROOT / "docs" / "tutorial"
ENDINGS = {"cpp": ".cpp", "c": ".c", "python": ".py"}


class Page:
    """The tutorial's page of a language: its programs, what they print, and the line that builds one of them."""

    def __init__(self, language):
        text = (TUTORIAL / f"{language}.md").read_text(encoding="utf-8")
        self.programs, self.shown = {}, {}
        name = None
        for kind, block in re.findall(r"^```(\w+)\n(.*?)^```$", text, re.M | re.S):
            named = re.match(r"(?://|/\*|#) (\w+)\.\w+", block)
            if kind == language and named:
                name = named[1]
                self.programs[name] = block
            elif kind == "text":
                self.shown[name] = block
        line = re.search(r"^    ((?:c\+\+|cc) .*)$", text, re.M)
        self.build_line = line[1] if line else ""


def programs_of_the_readme():
    """File name and text of each whole program: the words before it name its file."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = {}
    for name, code in re.findall(r"`(\w+\.cpp)`[^`]*?\n\n((?:    .*\n)+)", text):
        if "int main(" in code:
            found[name] = re.sub(r"^    ", "", code, flags=re.M)
    return found


def compiled_programs():
    """Path below the folder and text of each."""
    found = {f"readme/{name}": text for name, text in programs_of_the_readme().items()}
    for language in ("cpp", "c"):
        for name, text in Page(language).programs.items():
            found[f"{language}/{name}{ENDINGS[language]}"] = text
    return found


def write(folder):
    """What has not changed keeps its time, so that only what has is compiled again."""
    for name, text in compiled_programs().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write(pathlib.Path(sys.argv[1]))
