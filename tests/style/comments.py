"""The rule on the first word of comments in C and C++."""

import re

from tree import CODE_FOLDERS, CPP_SUFFIXES

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
    """No comment opens with a free relative clause."""
    for file in tree.files(CODE_FOLDERS, CPP_SUFFIXES):
        for number, word in _first_words_of_comments(file):
            if word in _RELATIVE_OPENINGS:
                yield f"{file.path}:{number}: the comment opens with '{word}'; say first what the thing is"
