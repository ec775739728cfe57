"""Answers questions: adds the numbers of each question. See ask.py."""

import sys

import gimnet


def main() -> None:
    with gimnet.connect("calc") as node:
        for question in node.answer("add"):  # its full name is calc/add
            try:
                numbers = [float(word) for word in question.text.split()]
            except ValueError:
                question.fail(1, "these are not only numbers")
                continue
            try:
                question.reply(f"{sum(numbers):f}")
            except gimnet.GimnetError as error:  # the program that asked may be gone
                print("adder:", error, file=sys.stderr)


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"adder: {error}")
