#!/usr/bin/env python3
"""Every constant, struct and function that the Python package names is that of the C headers.

    layout_test.py C_COMPILER"""

import ctypes
import pathlib
import re
import sys
import unittest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "abi"))

import public_headers  # noqa: E402
from gimnet import _c, errors  # noqa: E402


def python_layout():
    lines = set()
    for name, value in vars(_c).items():
        if isinstance(value, type) and issubclass(value, ctypes.Structure):
            lines.add(f"struct {name} {ctypes.sizeof(value)}")
            for member, *_ in value._fields_:
                field = getattr(value, member)
                lines.add(f"{name}.{member} {field.offset} {field.size}")
        elif name.startswith("GIMI_"):
            lines.add(f"{name} {value}")
    return lines


class Layout(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.compiled = public_headers.layout(COMPILER)

    def test_structs_and_constants_are_those_of_c(self):
        lines = python_layout()
        self.assertGreater(len(lines), 150)
        self.assertEqual(lines - set(self.compiled), set())

    def test_no_member_is_left_out(self):
        for name, members in public_headers.structs().items():
            if hasattr(_c, name):
                self.assertEqual([member for member, *_ in getattr(_c, name)._fields_], members, name)

    def test_functions_have_the_parameters_of_c(self):
        """As many, and where C has a 64-bit number, a pointer or a size, so has Python."""
        text = public_headers.text()
        for name in _c.FUNCTIONS:
            declared = re.search(rf"\b{name}\((.*?)\);", text, re.DOTALL)
            self.assertTrue(declared, name)
            words = [] if declared[1] == "void" else declared[1].split(",")
            sizes = [8 if re.search(r"\*|gimi_handle|size_t|int64_t", word) else 4 for word in words]
            self.assertEqual([ctypes.sizeof(kind) for kind in getattr(_c.lib, name).argtypes], sizes, name)

    def test_each_status_has_an_exception(self):
        statuses = re.search(r"typedef int32_t gimi_status;\s*enum \{(.*?)\}", public_headers.text(), re.DOTALL)
        names = re.findall(r"(GIMI_\w+) =", statuses[1])
        self.assertGreater(len(names), 20)
        self.assertEqual({getattr(_c, name) for name in names} - {0}, set(errors.BY_STATUS))
        self.assertEqual(len(set(errors.BY_STATUS.values())), len(errors.BY_STATUS))


if __name__ == "__main__":
    COMPILER = sys.argv.pop()
    unittest.main()
