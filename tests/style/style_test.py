#!/usr/bin/env python3
"""Checks the whole tree against the house rules; ends with 1 and one line per violation if there is any."""

import sys
from pathlib import Path

from rules import RULES
from tree import Tree


def main():
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2]
    tree = Tree(root)
    violations = [f"{sentence}  [{rule.__name__}]" for rule in RULES for sentence in rule(tree)]
    print("\n".join(violations) if violations else f"style: {len(RULES)} rules hold")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
