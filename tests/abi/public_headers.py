"""What the public C headers declare: functions, structs with their members, and constants; and the numbers that a C compiler
gives to them."""

import pathlib
import re
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "include"
TIMEOUT_S = 60
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_FUNCTION = re.compile(r"^GIMNET_API\s[^;(]*?(\w+)\(", re.MULTILINE)
_STRUCT = re.compile(r"^typedef struct (\w+) \{(.*?)^\} \1;", re.MULTILINE | re.DOTALL)
_MEMBER = re.compile(r"(\w+)(?:\[[^\]]*\])?\s*;")
_ENUM = re.compile(r"\benum(?: \w+)? \{(.*?)\}", re.DOTALL)
_ENUMERATOR = re.compile(r"^\s*([A-Z]\w+)")
_MACRO = re.compile(r"^#define ((?:NIF|GIMI|BITESTREAM)_\w+) (?!\\)(?!\s*\{)\S", re.MULTILINE)


def headers():
    """Their names as in an #include."""
    return sorted(path.relative_to(INCLUDE).as_posix() for path in INCLUDE.rglob("*.h"))


def text():
    """Of all headers, without comments."""
    return "\n".join(_COMMENT.sub("", (INCLUDE / name).read_text(encoding="utf-8")) for name in headers())


def functions():
    return sorted(_FUNCTION.findall(text()))


def structs():
    """Members by the name of the struct."""
    return {name: _MEMBER.findall(body) for name, body in _STRUCT.findall(text())}


def constants():
    everything = text()
    enumerators = [match[1] for body in _ENUM.findall(everything) for line in body.split(",") if (match := _ENUMERATOR.match(line))]
    return enumerators + _MACRO.findall(everything)


def layout(compiler):
    """Lines: `struct NAME SIZE`, `NAME.MEMBER OFFSET SIZE`, `CONSTANT VALUE`."""
    lines = ["#include <stdio.h>", *(f'#include "{name}"' for name in headers()), "int main(void) {"]
    for name, members in structs().items():
        lines.append(f'  printf("struct {name} %zu\\n", sizeof({name}));')
        for member in members:
            lines.append(f'  printf("{name}.{member} %zu %zu\\n", offsetof({name}, {member}), sizeof((({name}*)0)->{member}));')
    lines += [f'  printf("{name} %lld\\n", (long long)({name}));' for name in constants()]
    with tempfile.TemporaryDirectory() as folder:
        source, program = pathlib.Path(folder) / "layout.c", pathlib.Path(folder) / "layout"
        source.write_text("\n".join([*lines, "  return 0;", "}", ""]))
        subprocess.run([compiler, "-std=c11", f"-I{INCLUDE}", source, "-o", program], stdin=subprocess.DEVNULL, timeout=TIMEOUT_S,
                       check=True)
        return subprocess.run([program], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, timeout=TIMEOUT_S,
                              check=True).stdout.splitlines()
