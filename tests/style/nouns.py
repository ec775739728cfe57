"""The rules about nouns: the size of a header with the source of that name, and the names of classes."""

import re

from tree import CPP_SUFFIXES, HEADER_SUFFIXES

SMALL_HEADER_LINES = 40
SMALL_HEADER_USERS = 3

# In formatted code a type of a namespace begins its line. The head ends at "{"; at ";" it only declares.
_TYPE = re.compile(r"^(?:template <[^{;]*>\s+)?(?:class|struct|union|enum(?: class)?) "
                   r"(?:\w+\([^{;]*?\) |[A-Z]+(?:_[A-Z]+)+ |\[\[.*?\]\] )*(\w+)(?= final| :|\s*\{)[^{;]*\{",
                   re.MULTILINE)


def small_headers_are_shared(tree):
    """A header and its source of less than 40 lines in all stand in the file of their only users."""
    lines, users = {}, {}
    for file in tree.files(("src",), CPP_SUFFIXES):
        noun = file.path[4:].rsplit(".", 1)[0]
        lines[noun] = lines.get(noun, 0) + len(file.lines)
        for include in file.includes():
            users.setdefault(include.name.rsplit(".", 1)[0], set()).add(noun)
    for header in tree.files(("src",), HEADER_SUFFIXES):
        noun = header.path[4:].rsplit(".", 1)[0]
        count = len(users.get(noun, set()) - {noun})
        if lines[noun] < SMALL_HEADER_LINES and count < SMALL_HEADER_USERS:
            yield f"{header.path}: {lines[noun]} lines for {count} users: move it to one of them"


def class_names_exist_once(tree):
    """Classes, enumerations and unions of src/, of namespaces and of single files alike. A nested type is named
    together with its class, and is free."""
    places = {}
    for file in tree.files(("src",), CPP_SUFFIXES):
        code = "\n".join(file.code_lines())
        for match in _TYPE.finditer(code):
            place = f"{file.path}:{code.count(chr(10), 0, match.start(1)) + 1}"
            if match[1] in places:
                yield f"{place}: {match[1]} is the name of a type in {places[match[1]]} already"
            places.setdefault(match[1], place)


# A member function that a file defines outside of its class: the classes that it is named with.
_MEMBER = re.compile(r"^(?![\s#}/])[^;{}()=]*?(?<![\w:])((?:[a-z]\w*::)*(?:[A-Z]\w*(?:<[^<>()]*>)?::)+)"
                     r"(?:~?\w+|operator[^\s\w]+|operator \w[^()]*)\([^;{]*\{", re.MULTILINE)


def class_in_one_source(tree):
    """The member functions of a class stand in one source. Two sources are a class cut into slices: the second one
    wants to be a class. A nested class may have a source of its own."""
    sources = {}
    for file in tree.files(("src",), CPP_SUFFIXES):
        for match in _MEMBER.finditer("\n".join(file.code_lines())):
            name = re.sub(r"<[^<>]*>", "", match[1])[:-2]
            sources.setdefault(name, {}).setdefault(file.path.rsplit(".", 1)[0], file.path)
    for name, found in sources.items():
        if len(found) > 1:
            yield f"{name} has its functions in {' and '.join(found.values())}: find the second class in it"
