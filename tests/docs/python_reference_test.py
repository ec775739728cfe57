#!/usr/bin/env python3
"""The reference of the Python package has all that is public, without a warning; what has no docstring is a warning."""

import ast
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
UNDOCUMENTED = '''"""A package."""
__all__ = ["Told", "asked", "gone"]
class Base:
    def close(self) -> None:
        """Ends it."""
class Told(Base):
    """A class."""
    x: int
    def close(self) -> None: pass
    def silent(self) -> None: pass
    def _own(self) -> None: pass
def asked(question: str) -> str: return question
'''


def make(package, folder):
    """What the generator says, and the page."""
    ended = subprocess.run([sys.executable, ROOT / "python" / "make_reference.py", package, folder], capture_output=True, text=True,
                           timeout=60, check=False)
    return ended.returncode, ended.stderr, (pathlib.Path(folder) / "index.html").read_text(encoding="utf-8")


class Reference(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_the_package_is_documented(self):
        code, said, page = make(ROOT / "python" / "gimnet", self.folder / "out")
        self.assertEqual((code, said), (0, ""))
        for shown in ("class Node(", "subscribe(full_name: str, *, ", "subscribers: int", "class NotFound(", "connect(name: str="):
            self.assertIn(shown, page)
        self.assertNotIn("_handle", page)

    def test_the_guide_names_all_that_is_public(self):
        guide = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
        package = ast.parse((ROOT / "python" / "gimnet" / "__init__.py").read_text(encoding="utf-8"))
        names = next(ast.literal_eval(one.value) for one in package.body if isinstance(one, ast.Assign))
        self.assertGreater(len(names), 40)
        self.assertEqual([name for name in names if not re.search(rf"\b{name}\b", guide)], [])

    def test_each_gap_is_a_warning(self):
        package = self.folder / "package"
        package.mkdir()
        (package / "__init__.py").write_text(UNDOCUMENTED)
        code, said, page = make(package, self.folder / "out")
        self.assertEqual(code, 1)
        for name in ("Told.silent has no docstring", "asked has no docstring", "gone is in __all__"):
            self.assertEqual(said.count(name), 1, said)
        self.assertEqual(len(said.splitlines()), 3, said)
        self.assertIn("x: int", page)


if __name__ == "__main__":
    unittest.main()
