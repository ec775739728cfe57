#!/usr/bin/env python3
"""The table of planted bugs: texts are found whatever their white space, exactly once, and edits follow each other."""

import tempfile
import unittest
from pathlib import Path

import planted
from planted import Bug, Edit, Mistake


class Span(unittest.TestCase):
    def test_ignores_white_space(self):
        text = "if (a  <\n    b) c();"
        begin, end = planted.span(text, "if(a < b)")
        self.assertEqual(text[begin:end], "if (a  <\n    b)")

    def test_refuses_what_is_not_there_or_there_twice(self):
        for find, saying in (("d", "not there"), ("a", "more than once"), (" \n", "empty"), ("aa", "not there")):
            with self.assertRaisesRegex(Mistake, saying):
                planted.span("a b a", find)

    def test_refuses_places_that_overlap(self):
        with self.assertRaisesRegex(Mistake, "more than once"):
            planted.span("aaa", "aa")


class Changed(unittest.TestCase):
    def setUp(self):
        self.sources = {"a.cpp": "one two three", "b.cpp": "four"}

    def change(self, *edits):
        return planted.changed(Bug("A", "", "gimnet-sim", [Edit(*edit) for edit in edits]), self.sources.__getitem__)

    def test_applies_edits_in_order(self):
        self.assertEqual(self.change(("a.cpp", "two", "2"), ("b.cpp", "four", ""), ("a.cpp", "2 three", "3")),
                         {"a.cpp": "one 3", "b.cpp": ""})

    def test_names_bug_and_file_of_a_mistake(self):
        with self.assertRaisesRegex(Mistake, "A: a.cpp: not there: 'five'"):
            self.change(("a.cpp", "five", ""))


class Table(unittest.TestCase):
    def test_writes_changed_copies_only(self):
        bug = planted.load()[0]
        with tempfile.TemporaryDirectory() as folder:
            planted.write(bug, Path(folder))
            written = [str(path.relative_to(folder)) for path in Path(folder).rglob("*") if path.is_file()]
            self.assertEqual(sorted(written), bug.files())
            for file in bug.files():
                self.assertNotEqual(Path(folder, file).read_text(), planted.read_source(file))

    def test_fits_the_sources(self):
        bugs = planted.load()
        self.assertEqual(planted.check(bugs), [])
        self.assertGreaterEqual(len(bugs), 50)

    def test_refuses_two_bugs_of_one_name_and_bugs_without_an_edit(self):
        bug = '[[bug]]\nname = "A"\nbreaks = "b"\nprogram = "p"\n'
        edit = '[[bug.edit]]\nfile = "f"\nfind = "x"\nreplace = "y"\n'
        with self.assertRaisesRegex(Mistake, "two bugs are named A"):
            planted.load(2 * (bug + edit))
        with self.assertRaisesRegex(Mistake, "A has no edit"):
            planted.load(bug)

    def test_refuses_to_run_a_bug_that_is_not_there(self):
        with self.assertRaisesRegex(Mistake, "there is no bug NOBODY"):
            planted.run([], Path("/nowhere"), ["NOBODY"])
        bug = Bug("A", "", "gimnet-sim", [])
        with self.assertRaisesRegex(Mistake, "planted.a is not built"):
            planted.run([bug], Path("/nowhere"), ["A"])


if __name__ == "__main__":
    unittest.main()
