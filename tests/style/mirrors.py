"""The rules about tests: each source has one, and each is built."""

import re

UNTESTED_LIST = "tests/style/untested_sources.txt"
UNTESTED_MAX = 12


def _has_mirrored_test(tree, source):
    stem = source.removeprefix("src/").rsplit(".", 1)[0]
    return any(tree.exists(f"tests/{stem}_test{suffix}") for suffix in (".cpp", ".c", ".py"))


def tests_mirror_sources(tree):
    excused, without_test = {}, 0
    for number, line in tree.list_entries(UNTESTED_LIST):
        source, _, reason = (part.strip() for part in line.partition(":"))
        excused[source] = reason
        where = f"{UNTESTED_LIST}:{number}:"
        if not reason:
            yield f"{where} {source} has no reason"
        elif reason.startswith("tests/"):
            if not tree.exists(reason.split()[0]):
                yield f"{where} {reason.split()[0]} does not exist"
        else:
            without_test += 1
        if not tree.exists(source) or _has_mirrored_test(tree, source):
            yield f"{where} {source} does not exist or has its own test: take it off the list"
    if without_test > UNTESTED_MAX:
        yield f"{UNTESTED_LIST}: {without_test} sources without a test, at most {UNTESTED_MAX}"
    for file in tree.files(("src",), (".cpp", ".c")):
        if file.path not in excused and not _has_mirrored_test(tree, file.path):
            yield f"{file.path}: no {file.path.replace('src', 'tests', 1).rsplit('.', 1)[0]}_test.cpp"


def tests_are_built(tree):
    """Each test of C++ stands in a CMakeLists.txt of its folder or of one above. The name may lack `_test.cpp`."""
    lists = {file.path.removesuffix("CMakeLists.txt"): set(re.split(r"[\s()]+", file.text))
             for file in tree.files(("tests",), (".txt",)) if file.path.endswith("CMakeLists.txt")}
    for file in tree.files(("tests",), (".cpp",)):
        words = set().union(*(words for folder, words in lists.items() if file.path.startswith(folder)))
        parts = file.path.split("/")
        names = {"/".join(parts[at:]) for at in range(len(parts))}
        names |= {name.removesuffix("_test.cpp") for name in names}
        if file.path.endswith("_test.cpp") and not names & words:
            yield f"{file.path}: no CMakeLists.txt names it, so nobody builds it"
