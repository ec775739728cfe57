#!/usr/bin/env python3
"""The C and C++ that the documents and the public headers show compiles, without a warning, as a newcomer would paste it.

What is code: lines that are indented by four spaces, in a header behind the sign of the comment. They are paragraphs, between empty
lines; one is C or C++ where a line of it ends in `;` or `{`. One with a main() is compiled by itself. A page is read from top to bottom: each paragraph stands in a scope
within that of the one before it, so that it may use what was declared above, or declare it anew. What a page takes for granted
beside that stands in PAGES.

    snippets_test.py --cxx COMPILER... --c COMPILER..."""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
from dataclasses import dataclass

ROOT = pathlib.Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "include"
GIMI_OPTIONS = INCLUDE / "gimnet" / "gimi" / "options.hpp"
STRICT = ("-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{INCLUDE}")
LANGUAGES = {"c": ("-std=c11", "-xc"), "c++": ("-std=c++20", "-xc++")}
PATIENCE_S = 300


@dataclass(frozen=True)
class Page:
    """`before` stands ahead of main(), `within` at its beginning."""
    language: str
    before: str
    within: str = ""


GIMI = '#include <iostream>\n#include <vector>\n#include "gimnet/gimi.hpp"\ntemplate <class... Parts>\nvoid show(const Parts&...) {}\n'
GIMI_C = '#include <stdio.h>\n#include "gimnet/gimi.h"\nvoid show(const void* data, size_t size);\n'
PAGES = {
    "README.md": Page("c++", GIMI),
    "docs/gimi.md": Page("c++", "#include <algorithm>\n" + GIMI + '#include "gimnet/gimi/executor.hpp"\n' + "std::string_view position();\nvoid stop();\nvoid forget_all();\nstd::string sum_of(std::string_view numbers);\n",
                         "std::vector<std::byte> pixels;\ngimnet::Node calc(\"calc\");\n"),
    "docs/nif.md": Page("c", '#include <stdio.h>\n#include "gimnet/nif.h"\n', "uint32_t peer = 1;\nnif_node* node = NULL;\n"),
    "include/gimnet/gimi.h": Page("c", GIMI_C),
    "include/gimnet/gimi_requests.h": Page("c", GIMI_C, "gimi_handle node = 0, add = 0;\n"),
    "include/gimnet/gimi_wait.h": Page("c", GIMI_C + "void take(uint64_t user, gimi_message* message);\n",
                                       "gimi_handle pose = 0, orders = 0;\ngimi_message message;\n"),
    "include/gimnet/gimi.hpp": Page("c++", GIMI),
    "include/gimnet/gimi/executor.hpp": Page("c++", GIMI + '#include "gimnet/gimi/executor.hpp"\n' + "std::string_view position();\n",
                                             "gimnet::Node node(\"a\");\nauto pose = node.subscribe(\"b/pose\").or_throw();\n"
                                             "auto odometry = node.advertise(\"odometry\").or_throw();\n"),
    "include/gimnet/nif.h": Page("c", '#include <stdio.h>\n#include "gimnet/nif.h"\nvoid show(const nif_incoming* in);\n',
                                 "uint32_t peer = 1;\n"),
    "include/gimnet/bitestream.h": Page("c", '#include "gimnet/bitestream.h"\nvoid send(const void* bytes, size_t size);\n'),
}


def documents():
    """All that may show code, by their paths in the tree. tests/install/tutorial_test.py runs that of the tutorial."""
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*.md"), *INCLUDE.rglob("*.h*")]
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in sorted(found)
            if path.parent.name != "tutorial"}


def paragraphs(name, text):
    """Of code in C or C++: the number of the first line, and the lines."""
    margin = re.compile(r"(?:///?| ?\*)     (.*)" if "/" in name and not name.endswith(".md") else r"    (.*)")
    found, lines = [], []
    for number, line in enumerate([*text.splitlines(), ""], 1):
        indented = margin.fullmatch(line)
        if indented:
            lines.append(indented[1])
            continue
        if any(re.search(r"[;{]$", re.sub(r"\s*//.*", "", each)) for each in lines):
            found.append((number - len(lines), lines))
        lines = []
    return found


def program(name, page, found):
    parts = [page.before, "int main(void) {\n", page.within]
    for number, lines in found:
        parts.append(f'{{\n#line {number} "{name}"\n' + "\n".join(lines) + "\n")
    return "".join(parts) + "}" * len(found) + "\nreturn 0;\n}\n"


def is_program(lines):
    """It stands for itself, with all that it includes."""
    return any(line.startswith("int main(") for line in lines)


def programs(name, page, found):
    """What to compile: each whole program, and one of all other paragraphs."""
    whole = [f'#line {number} "{name}"\n' + "\n".join(lines) + "\n" for number, lines in found if is_program(lines)]
    return [*whole, program(name, page, [each for each in found if not is_program(each[1])])]


class Snippets(unittest.TestCase):
    compilers = {}

    def complaints(self, language, text):
        """What each compiler says of it, by its name; "" of one that has nothing to say."""
        said = {}
        for compiler in self.compilers[language]:
            with tempfile.NamedTemporaryFile("w", suffix=".txt", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                ended = subprocess.run([compiler, *LANGUAGES[language], *STRICT, file.name], capture_output=True, text=True,
                                       timeout=PATIENCE_S, check=False)
            said[compiler] = ended.stderr if ended.returncode else ""
        return said

    def assert_compiles(self, language, text):
        for compiler, said in self.complaints(language, text).items():
            self.assertEqual(said, "", f"{compiler}:\n{said}")

    def test_each_page_compiles(self):
        for name, text in documents().items():
            found = paragraphs(name, text)
            if not found:
                self.assertNotIn(name, PAGES, "it shows no code")
                continue
            with self.subTest(page=name):
                self.assertIn(name, PAGES, f"it shows code, in line {found[0][0]}: say in PAGES what it takes for granted")
                page = PAGES[name]
                for text_of_program in programs(name, page, found):
                    self.assert_compiles(page.language, text_of_program)

    def test_what_warns_is_seen(self):
        page = PAGES["docs/gimi.md"]
        for line, said in (('node.send("b", "hello");', "ignoring return"), ("gimnet::Nodes other;", "Nodes"), ("int x;", "unused")):
            found = paragraphs("page.md", f"Words.\n\n    gimnet::Node node;\n\nWords; and more;\n\n    {line}   // why\n")
            self.assertEqual([number for number, _ in found], [3, 7])
            for compiler, words in self.complaints("c++", program("page.md", page, found)).items():
                with self.subTest(compiler=compiler, line=line):
                    self.assertIn("page.md:7:", words)
                    self.assertIn(said, words)

    def test_a_header_shows_code_in_its_comments(self):
        for sign in ("//", " *"):
            text = f"{sign} Words;\n{sign}\n{sign}     int a = 1;\n{sign}     f(a);\n{sign}\nint b;\n"
            self.assertEqual(paragraphs("include/a.h", text), [(3, ["int a = 1;", "f(a);"])])

    def test_a_whole_program_is_compiled_by_itself(self):
        found = paragraphs("page.md", "    int main() {\n      int x;\n    }\n\nWords.\n\n    int y = 1;\n    show(y);\n")
        whole, rest = programs("page.md", PAGES["README.md"], found)
        self.assertEqual(whole, '#line 1 "page.md"\nint main() {\n  int x;\n}\n')
        self.assertIn("int y = 1;", rest)
        self.assertNotIn("int x;", rest)

    def test_what_is_no_code_is_left_alone(self):
        for text in ("    ./dev build\n    tcphub      # a comment\n", "    00 01 02   key 1 u8: 7\n", "no code;\n", "   int three_spaces;\n"):
            self.assertEqual(paragraphs("page.md", text), [])

    def test_any_member_of_the_options_can_be_named_alone(self):
        structs = re.findall(r"^struct (\w+Options) \{\n(.*?)^\};", GIMI_OPTIONS.read_text(encoding="utf-8"), re.S | re.M)
        self.assertGreaterEqual(len(structs), 7, "the header was not understood")
        uses = []
        for name, body in structs:
            members = re.findall(r"^  [\w:<>]+ (\w+)(?:;|\{| =)", body, re.M)
            self.assertGreaterEqual(len(members), 2, name)
            uses += [f"gimnet::{name} {name}_{member}{{.{member} = {{}}}};\nshow({name}_{member});" for member in members]
        self.assert_compiles("c++", GIMI + "int main() {\n" + "\n".join(uses) + "\n}\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--cxx", nargs="+", required=True)
    parser.add_argument("--c", nargs="+", required=True)
    given, rest = parser.parse_known_args()
    Snippets.compilers = {"c++": given.cxx, "c": given.c}
    unittest.main(argv=[sys.argv[0], *rest])


if __name__ == "__main__":
    main()
