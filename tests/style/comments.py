"""The rule on the first word of comments in C and C++."""

import re

from tree import CODE_FOLDERS, CPP_SUFFIXES

OLD_COMMENTS_LIST = "tests/style/old_comments.txt"

_COMMENT = re.compile(r"^(\s*)(?://[/!]?<?|/\*\*?)\s*(\w*)")
_TRAILING_COMMENT = re.compile(r"\S\s+//[/!]?<?\s*(\w+)")
_RELATIVE_OPENINGS = ("What", "Who", "Whoever", "Where", "How")


def _first_words_of_comments(file):
    """(line, first word) of each comment of a C or C++ file; several lines of // are one comment."""
    in_comment = False
    for number, line in enumerate(file.lines, 1):
        match = _COMMENT.match(line)
        if match and not in_comment:
            yield number, match[2]
        if not match and (trailing := _TRAILING_COMMENT.search(line)) and '"' not in line:
            yield number, trailing[1]
        in_comment = bool(match)


def comments_open_with_their_subject(tree):
    """No comment opens with a free relative clause. The list of files that are not done yet may only shrink."""
    listed = {line for _, line in tree.list_entries(OLD_COMMENTS_LIST)}
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES):
        found = [(number, word) for number, word in _first_words_of_comments(file) if word in _RELATIVE_OPENINGS]
        if file.path in listed and not found:
            yield f"{OLD_COMMENTS_LIST}: {file.path} is done: take it off the list"
        if file.path not in listed:
            for number, word in found:
                yield f"{file.path}:{number}: the comment opens with '{word}'; say first what the thing is"
        listed.discard(file.path)
    for path in sorted(listed):
        yield f"{OLD_COMMENTS_LIST}: there is no {path}"
