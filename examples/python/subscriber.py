"""Prints the messages of publisher.py. It may be started first, and goes on when the publisher or the
hub was away."""

import sys

import gimnet


def main() -> None:
    with gimnet.connect() as node:  # without a name: nobody has to find it
        for message in node.subscribe("robot/odom"):
            print(f"{message.sender} #{message.sequence}: {message.text}", flush=True)


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"subscriber: {error}")
