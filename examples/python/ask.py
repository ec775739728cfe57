"""Asks adder.py for the sum of each line of standard input: echo 1.5 2 | python3 ask.py"""

import sys

import gimnet


def main() -> int:
    failed = 0
    with gimnet.connect() as node:
        for line in sys.stdin:
            numbers = line.rstrip("\n")
            try:
                # Ends in one of many ways: a reply, nobody answers there, no reply within two seconds, ...
                reply = node.request("calc/add", numbers, timeout=2.0)
                print(f"{numbers}: {reply.text}", flush=True)
            except gimnet.GimnetError as error:
                print(f"ask: {numbers}: {error}", file=sys.stderr)
                # If the work may have been done, a program that pays or opens a door asks again with care.
                if error.ran != "no":
                    print("ask: calc may have added them", file=sys.stderr)
                failed = 1
    return failed


try:
    sys.exit(main())
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"ask: {error}")
