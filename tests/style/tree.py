"""The source tree as the style rules see it: files by name, lines, includes, functions."""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

CODE_FOLDERS = ("include", "src", "tests", "fuzz", "bench", "perf", "examples", "python")
TEXT_FOLDERS = CODE_FOLDERS + ("docs", "cmake", ".ci")
CPP_SUFFIXES = (".cpp", ".hpp", ".c", ".h")
HEADER_SUFFIXES = (".hpp", ".h")

_INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
_RAW_STRING = re.compile(r'\b(?:u8|u|U|L)?R"([^()\s\\]{0,16})\(.*?\)\1"', re.DOTALL)
_BLOCK_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_LINE_COMMENT = re.compile(r"//.*")
_NOT_A_FUNCTION = re.compile(
    r"(template\s*<[^{]*>\s*)?(if|else|for|while|do|switch|try|catch|namespace|class|struct|enum|union|case|default)\b|[}:]"
)


@dataclass(frozen=True)
class Include:
    line: int
    quoted: bool
    name: str


@dataclass(frozen=True)
class Function:
    name: str
    line: int
    length: int


class SourceFile:
    """One file. Thread safety: none; reads lazily, once."""

    def __init__(self, root, path):
        self.path = path.relative_to(root).as_posix()
        self.suffix = path.suffix
        self.text = path.read_text(encoding="utf-8", errors="replace")
        self.lines = self.text.splitlines()

    @property
    def is_cpp(self):
        return self.suffix in CPP_SUFFIXES

    def code_lines(self):
        """The lines without comments and raw strings, same count: what the compiler acts on."""
        text = _BLOCK_COMMENT.sub(_blank, _RAW_STRING.sub(_blank, self.text))
        return [_LINE_COMMENT.sub("", line) for line in text.splitlines()]

    def includes(self):
        found = []
        for number, line in enumerate(self.lines, 1):
            match = _INCLUDE.match(line)
            if match:
                found.append(Include(number, match[1] == '"', match[2]))
        return found

    def functions(self):
        if self.is_cpp:
            return list(_cpp_functions(self.code_lines()))
        if self.suffix == ".py":
            return list(_python_functions(self.text))
        return []


class Tree:
    def __init__(self, root):
        self.root = Path(root)

    def exists(self, path):
        return (self.root / path).is_file()

    def file(self, path):
        return SourceFile(self.root, self.root / path) if self.exists(path) else None

    def files(self, folders, suffixes=None):
        """Files below the folders, in order of name; without build products."""
        for folder in folders:
            for path in sorted((self.root / folder).rglob("*")):
                if not path.is_file() or "__pycache__" in path.parts or "build" in path.relative_to(self.root).parts:
                    continue
                if suffixes is None or path.suffix in suffixes:
                    yield SourceFile(self.root, path)

    def list_entries(self, path):
        """(line, text) of the lines of a list that are neither empty nor comments."""
        file = self.file(path)
        for number, line in enumerate(file.lines if file else (), 1):
            if line.strip() and not line.startswith("#"):
                yield number, line.strip()

    def top_level_files(self):
        for path in sorted(self.root.iterdir()):
            if path.is_file() and path.name != ".git":
                yield SourceFile(self.root, path)


def _blank(match):
    # What follows on the last line is indented, so that it does not look like the end of a block.
    newlines = match[0].count("\n")
    return '""' + "\n" * newlines + " " * (80 if newlines else 0)


def _indent(line):
    return len(line) - len(line.lstrip(" "))


def _cpp_functions(lines):
    """Functions in clang-formatted code: a closing brace stands at the indentation of the line that opened its block,
    and everything between is deeper."""
    for end, line in enumerate(lines):
        if not line.lstrip(" ").startswith("}"):
            continue
        start = _opening_line(lines, end, _indent(line))
        if start is None:
            continue
        head = _head(lines, start, end)
        if "(" in head and head.endswith("{") and not head.endswith("= {") and not _NOT_A_FUNCTION.match(head):
            yield Function(head[:-1].strip(), start + 1, end - start + 1)


def _opening_line(lines, end, indent):
    for number in range(end - 1, -1, -1):
        line = lines[number]
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if _indent(line) <= indent:
            return number if _indent(line) == indent else None
    return None


def _head(lines, start, end):
    head = []
    for line in lines[start:end]:
        head.append(line.strip())
        if line.rstrip().endswith("{"):
            break
    return " ".join(head)


def _python_functions(text):
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield Function(node.name, node.lineno, node.end_lineno - node.lineno + 1)
