"""The rule about the size of a noun: a header with the source of that name."""

from tree import CPP_SUFFIXES, HEADER_SUFFIXES

SMALL_HEADER_LINES = 40
SMALL_HEADER_USERS = 3


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
