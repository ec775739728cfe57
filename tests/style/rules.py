"""The house rules that a machine can check. Each rule is a function from a Tree to sentences, one per violation."""

import re
import sys
from pathlib import Path

from tree import CODE_FOLDERS, CPP_SUFFIXES, HEADER_SUFFIXES, TEXT_FOLDERS

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "planted"))
import planted  # noqa: E402
from comments import comments_open_with_their_subject  # noqa: E402
from mirrors import UNTESTED_LIST, UNTESTED_MAX, tests_are_built, tests_mirror_sources  # noqa: E402, F401
from nouns import class_in_one_source, class_names_exist_once, small_headers_are_shared  # noqa: E402

FILE_LINES_MAX = 400
# Grew beyond it when the columns went from 120 to 100; each leaves the list with its next change.
FILE_LINES_EXCUSED = ("include/gimnet/nif.h", "tests/client/gimi/service_table_moves_test.cpp",
                      "tests/hub/control/handle/administer_test.cpp")
LINE_COLUMNS_MAX = 100
FUNCTION_LINES_MAX = 59
PLANTED_TABLE = "tests/planted/bugs.toml"
REQUIREMENTS = "docs/requirements.md"

# Who may include whom: the table of docs/architecture.md, "Include rules". Longest prefix wins.
_BASE = ("base",)
_PROTO = _BASE + ("proto",)
_NET = _PROTO + ("net",)
_HUB_PARTS = ("hub/limits.hpp", "hub/observe/counters.hpp", "hub/observe/session_gauges.hpp")
_CONCURRENT = _PROTO + _HUB_PARTS + ("hub/concurrent",)
_DATA = _CONCURRENT + ("net/stream.hpp", "hub/data")
_SHARD = _DATA + ("net", "hub/shard")
_CONTROL = _SHARD + ("hub/version.hpp", "hub/observe", "hub/crypto", "hub/network/state",
                     "hub/control")
_NIF = _NET + ("client/nif",)
_GIMI = _NIF + ("client/gimi",)
MAY_INCLUDE = {
    "base": _BASE,
    "proto": _PROTO,
    "net": _NET,
    "hub/limits.hpp": _BASE,
    "hub/limits.cpp": _PROTO + ("hub/limits.hpp",),
    "hub/observe/counters.hpp": _PROTO,
    "hub/observe/session_gauges.hpp": _PROTO + ("hub/observe/counters.hpp",),
    "hub/observe/counters.cpp": _PROTO + ("hub/observe/counters.hpp",),
    "hub/concurrent": _CONCURRENT,
    "hub/data": _DATA,
    "hub/data/tables": _CONCURRENT + ("hub/data/tables",),
    "hub/data/fanout": _CONCURRENT + tuple(f"hub/data/{part}" for part in (
        "tables", "egress", "fanout", "buffer.hpp", "budget.hpp", "ring_queue.hpp")),
    "hub/shard": _SHARD,
    "hub/crypto": _BASE + ("hub/crypto",),
    "hub/control/state": _PROTO + ("hub/network/state", "hub/limits.hpp", "hub/crypto", "hub/control/state"),
    "hub/network/state": _PROTO + ("hub/limits.hpp", "hub/crypto", "hub/network/state"),
    "hub/control": _CONTROL,
    "hub/config": _CONTROL + ("hub/config",),
    "hub/observe": _CONCURRENT + ("hub/observe",),
    "hub": _NET + ("hub",),
    "client/nif": _NIF,
    "client/gimi": _GIMI,
    "impair": _NET + ("impair",),
    "tools": _GIMI + ("impair", "tools"),
    "examples": _GIMI + ("examples",),
}
# Public headers belong to the part that implements them.
PUBLIC_HEADERS = (("gimnet/export", "base"), ("gimnet/bitestream", "proto"), ("gimnet/nif", "client/nif"),
                  ("gimnet/gimi", "client/gimi"))

_SOCKETS = ("sys/socket.h", "sys/un.h", "sys/epoll.h", "netinet/", "arpa/", "netdb.h", "poll.h", "boost/asio")
_THREADS = ("thread", "mutex", "shared_mutex", "atomic", "condition_variable", "future", "semaphore", "latch",
            "barrier", "stop_token", "pthread.h", "stdatomic.h", "threads.h")
_LIBRARIES = ("boost/", "concurrentqueue/", "readerwriterqueue/", "fmt/", "spdlog/", "CLI/", "toml++/", "jemalloc/")
FORBIDDEN_INCLUDES = {
    "base": _LIBRARIES,
    "net": _LIBRARIES,
    "proto": _LIBRARIES + _SOCKETS + _THREADS,
    "client": _LIBRARIES,
    "hub/data": ("mutex", "shared_mutex", "condition_variable", "functional", "boost/asio"),
    "hub/control/state": _SOCKETS + _THREADS,
    "hub/network/state": _SOCKETS + _THREADS,
}

_SHARED_POINTER = re.compile(r"\b(shared_ptr|make_shared|weak_ptr|enable_shared_from_this|std::function)\b")
_MEMORY_ORDER = re.compile(r"\bmemory_order(_|::)(relaxed|consume|acquire|release|acq_rel|seq_cst)\b")
_SLEEP = re.compile(r"\b(sleep_for|sleep_until|usleep|nanosleep)\b|\b(time|asyncio)\.sleep\b|(?<![\w.])sleep\(")
_CLOCK = re.compile(r"\b\w*clock::now\b|\b(clock_gettime|gettimeofday|timespec_get)\b|"
                    r"(?<![\w.>])(?:std::|::)?time\(\s*(nullptr|NULL|0|&)")
_RANDOM = re.compile(r"\brandom_device\b|\b(random_bits|fill_randomly|getrandom|getentropy|s?rand|drand48|arc4random)\s*\(")
# What grows at one end and shrinks at the other, as a member, a local or an alias; and a vector made to do so.
_QUEUE = re.compile(r"^\s*(?:using \w+ = |static |mutable )*std::(deque|list|queue|priority_queue)<.*;")
_FRONT_ERASED = re.compile(r"\b(\w+)\.erase\(\1\.begin\(\)\)")
_BOUND = re.compile(r"\bk\w*Max\b|\w+_max_?\b|\blimits_?\.\w+")
_UNFINISHED = re.compile(r"\b(TODO|FIXME|HACK|XXX)\b|\bfor now\b", re.IGNORECASE)
_MACHINE_PATH = re.compile(r"(?<![\w.])/(work|root|home)/")
_REQUIREMENT = re.compile(r"^\| ([A-Z]-?\d+[a-z]?) \|.*\|([^|]*)\|$")
_TEST_PATH = re.compile(r"\b(?:tests|perf|fuzz|bench)/[\w./-]+")
_LINK = re.compile(r"\]\(([^)\s]+)\)")
# A public C header may guard itself in the way that every C compiler knows.
_INCLUDE_GUARD = re.compile(r"\A#ifndef (GIMNET_\w+_H)\n#define \1\n")
_FUZZ_TARGET = re.compile(r"^\s*gimnet_fuzz\(\s*(?:\S*/)?([A-Za-z0-9_]+)\.cpp", re.MULTILINE)


def _longest_prefix(name, prefixes):
    fitting = [p for p in prefixes if name == p or name.startswith(p.rstrip("/") + "/")]
    return max(fitting, key=len, default=None)


def part_of(name):
    """The part of the house that a file belongs to, `name` as in an #include; None for what is not placed."""
    for prefix, part in PUBLIC_HEADERS:
        if name.startswith(prefix):
            return part
    return _longest_prefix(name, MAY_INCLUDE)


def _part_files(tree):
    """(file, its name as in an #include) for everything that the arrows bind."""
    for file in tree.files(("src", "include"), CPP_SUFFIXES):
        yield file, file.path.split("/", 1)[1]
    for file in tree.files(("examples",), CPP_SUFFIXES):
        yield file, file.path


def include_arrows(tree):
    for file, name in _part_files(tree):
        part = part_of(name)
        if part is None:
            yield f"{file.path}: no rule says what this folder may include; place it in tests/style/rules.py"
            continue
        for include in file.includes():
            target = include.name
            ours = include.quoted or target.startswith("gimnet/")
            if not ours or (part == "examples" and "/" not in target):
                continue
            target = part_of(target) if target.startswith("gimnet/") else target
            if target is None or _longest_prefix(target, MAY_INCLUDE[part]) is None:
                yield f"{file.path}:{include.line}: {part} may not include \"{include.name}\""


def forbidden_includes(tree):
    for file, name in _part_files(tree):
        folder = _longest_prefix(name, FORBIDDEN_INCLUDES)
        if folder is None and part_of(name) == "proto":
            folder = "proto"
        for include in file.includes() if folder else ():
            if any(include.name == bad or (bad.endswith(("/", "asio")) and include.name.startswith(bad))
                   for bad in FORBIDDEN_INCLUDES[folder]):
                yield f"{file.path}:{include.line}: {folder} may not include <{include.name}>"


def no_shared_pointers_in_the_data_plane(tree):
    for file in tree.files(("src/hub/data",), CPP_SUFFIXES):
        for number, line in enumerate(file.code_lines(), 1):
            match = _SHARED_POINTER.search(line)
            if match:
                yield f"{file.path}:{number}: the data plane does not use {match[1]}"


def includes_from_src(tree):
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES):
        for include in file.includes():
            if "../" in include.name:
                yield f"{file.path}:{include.line}: includes start at src/, not with ../"


def own_header_first(tree):
    for file in tree.files(("src",), (".cpp", ".c")):
        stem = file.path.rsplit(".", 1)[0]
        own = next((stem + suffix for suffix in HEADER_SUFFIXES if tree.exists(stem + suffix)), None)
        includes = file.includes()
        if own and (not includes or includes[0].name != own.removeprefix("src/")):
            yield f"{file.path}:1: includes its own header {own} first"


def pragma_once(tree):
    for file in tree.files(CODE_FOLDERS, HEADER_SUFFIXES):
        guarded = file.path.startswith("include/") and file.suffix == ".h" and _INCLUDE_GUARD.search(file.text)
        if "#pragma once" not in file.lines and not guarded:
            yield f"{file.path}:1: no #pragma once"


def file_length(tree):
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES + (".py", ".sh")):
        if len(file.lines) > FILE_LINES_MAX and file.path not in FILE_LINES_EXCUSED:
            yield f"{file.path}: {len(file.lines)} lines, at most {FILE_LINES_MAX}: split it along a noun of the docs"


def line_length(tree):
    """Code: lines without a string, which nobody breaks. Markdown: prose, not tables or blocks."""
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES):
        raw_string = False
        for number, line in enumerate(file.lines, 1):
            raw_string = 'R"(' in line or (raw_string and ')"' not in line)
            if len(line) > LINE_COLUMNS_MAX and '"' not in line and "http" not in line and not raw_string:
                yield f"{file.path}:{number}: {len(line)} columns, at most {LINE_COLUMNS_MAX}"
    for file in (*tree.top_level_files(), *tree.files(TEXT_FOLDERS, (".md",))):
        if file.suffix != ".md":
            continue
        for number, line in enumerate(file.lines, 1):
            if len(line) > LINE_COLUMNS_MAX and not line.lstrip().startswith(("|", "![")) \
                    and not line.startswith("    ") and "http" not in line:
                yield f"{file.path}:{number}: {len(line)} columns, at most {LINE_COLUMNS_MAX}"


def function_length(tree):
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES + (".py",)):
        for function in file.functions():
            if function.length > FUNCTION_LINES_MAX:
                yield (f"{file.path}:{function.line}: {function.length} lines, at most {FUNCTION_LINES_MAX}: "
                       f"{function.name[:60]}")


def memory_orders_name_their_partner(tree):
    for file in tree.files(("src", "include"), CPP_SUFFIXES):
        code = file.code_lines()
        for number, line in enumerate(code):
            near = file.lines[max(0, number - 3) : number + 1]
            if _MEMORY_ORDER.search(line) and not any("//" in text for text in near):
                yield f"{file.path}:{number + 1}: a memory order without a comment on its partner operation"


def queues_name_their_limit(tree):
    for file in tree.files(("src",), CPP_SUFFIXES):
        code = file.code_lines()
        for number, line in enumerate(code):
            queue = _QUEUE.match(line)
            if queue and not re.search(r"& \w+\);$", line) and "(" not in re.sub(r"GIMNET_GUARDED_BY\(\w+\)", "", line):
                above = number
                while above > 0 and file.lines[above - 1].lstrip().startswith("//"):
                    above -= 1
                if not any("Limit: " in text for text in file.lines[above : number + 1]):
                    yield f"{file.path}:{number + 1}: a std::{queue[1]} without a comment `Limit: ...` that names its bound"
            front = _FRONT_ERASED.search(line)
            if front and not any(_BOUND.search(text) for text in code[max(0, number - 1) : number + 1]):
                yield f"{file.path}:{number + 1}: {front[1]} is used as a queue, and no bound is near"


# Who may ask for the time, and for randomness that no seed gives: everybody else is handed them, and can be simulated.
CLOCKS = ("src/base/clock.hpp",)
RANDOMNESS = ("src/base/random.hpp", "src/base/random.cpp", "src/hub/config/state_folder.cpp", "src/hub/shard/attacher.cpp",
              "src/client/nif/node_thread.hpp", "src/client/nif/node_thread.cpp", "src/client/gimi/uplink.cpp")


def time_and_chance_are_handed_in(tree):
    for file in tree.files(("src",), CPP_SUFFIXES):
        for number, line in enumerate(file.code_lines(), 1):
            if file.path not in CLOCKS and _CLOCK.search(line):
                yield f"{file.path}:{number}: reads a clock; only {CLOCKS[0]} does"
            if file.path not in RANDOMNESS and _RANDOM.search(line):
                yield f"{file.path}:{number}: takes randomness that no seed gives"
            if _SLEEP.search(line):
                yield f"{file.path}:{number}: sleeps; wait for what comes, with a deadline"


def no_sleeps_in_tests(tree):
    for file in tree.files(("tests",), CPP_SUFFIXES + (".py",)):
        if "support" in file.path.split("/") or file.path.startswith("tests/style/"):
            continue
        for number, line in enumerate(file.lines, 1):
            if _SLEEP.search(line):
                yield f"{file.path}:{number}: a test waits for a condition with a deadline, it does not sleep"


def _all_text(tree):
    yield from tree.top_level_files()
    for file in tree.files(TEXT_FOLDERS):
        if not file.path.startswith(("tests/style/", "fuzz/seeds/")):
            yield file


def no_machine_paths(tree):
    for file in _all_text(tree):
        for number, line in enumerate(file.lines, 1):
            if _MACHINE_PATH.search(line):
                yield f"{file.path}:{number}: names a place on somebody's machine"


def nothing_left_for_later(tree):
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES + (".py", ".sh", ".txt")):
        if file.path.startswith(("tests/style/", "fuzz/seeds/")):
            continue
        for number, line in enumerate(file.lines, 1):
            match = _UNFINISHED.search(line)
            if match:
                yield f"{file.path}:{number}: '{match[0]}': finish it or leave it out"


def planted_bugs_fit(tree):
    """The table of planted bugs fits the sources, each fuzz target has one, and the product has none."""
    for file in tree.files(("src", "include"), CPP_SUFFIXES):
        if "GIMNET_BUG" in file.text:
            yield f"{file.path}: planted bugs stand in {PLANTED_TABLE}, not in the product"
    table = tree.file(PLANTED_TABLE)
    try:
        bugs = planted.load(table.text if table else "")
    except (planted.Mistake, ValueError, TypeError) as mistake:
        yield f"{PLANTED_TABLE}: {mistake}"
        return
    for mistake in planted.check(bugs, lambda path: _text_of(tree, path)):
        yield f"{PLANTED_TABLE}: {mistake}"
    targets = {name for file in tree.files(("fuzz",), (".txt",)) if file.path.endswith("CMakeLists.txt")
               for name in _FUZZ_TARGET.findall(file.text)}
    for program in sorted({bug.program for bug in bugs if "." in bug.program}):
        if not tree.exists(f"tests/{program.replace('.', '/')}.cpp"):
            yield f"{PLANTED_TABLE}: there is no test {program}"
    with_bug = {bug.program for bug in bugs if bug.program.endswith("_fuzz")}
    for target in sorted(with_bug - targets):
        yield f"{PLANTED_TABLE}: there is no fuzz target {target}"
    for target in sorted(targets - with_bug):
        yield f"{PLANTED_TABLE}: the fuzz target {target} has no bug that it must find"


def _text_of(tree, path):
    file = tree.file(path)
    if file is None:
        raise planted.Mistake("there is no such file")
    return file.text


def requirements_name_tests_that_exist(tree):
    file = tree.file(REQUIREMENTS)
    for number, line in enumerate(file.lines if file else (), 1):
        row = _REQUIREMENT.match(line)
        if not row:
            continue
        tests = [path.rstrip(".") for path in _TEST_PATH.findall(row[2])]
        if not tests and row[2].strip() != "open":
            yield f"{REQUIREMENTS}:{number}: {row[1]} names neither a test nor 'open'"
        for path in tests:
            if not (tree.root / path).exists():
                yield f"{REQUIREMENTS}:{number}: {path} does not exist"


def links_resolve(tree):
    documents = [file for file in tree.top_level_files() if file.suffix == ".md"]
    documents += list(tree.files(TEXT_FOLDERS, (".md",)))
    for file in documents:
        for number, line in enumerate(file.lines, 1):
            for link in _LINK.findall(line):
                target = link.split("#")[0]
                if target and ":" not in target and not ((tree.root / file.path).parent / target).exists():
                    yield f"{file.path}:{number}: the link to {target} leads nowhere"


RULES = (
    include_arrows,
    forbidden_includes,
    no_shared_pointers_in_the_data_plane,
    includes_from_src,
    own_header_first,
    pragma_once,
    file_length,
    line_length,
    function_length,
    memory_orders_name_their_partner,
    queues_name_their_limit,
    time_and_chance_are_handed_in,
    no_sleeps_in_tests,
    no_machine_paths,
    nothing_left_for_later,
    small_headers_are_shared,
    class_names_exist_once,
    class_in_one_source,
    tests_mirror_sources,
    tests_are_built,
    planted_bugs_fit,
    comments_open_with_their_subject,
    requirements_name_tests_that_exist,
    links_resolve,
)
