"""A loop of the program's own, with select, as Qt and asyncio have one: shows where the robot of
wait_set.py is, and asks it to drive at each speed that standard input says."""

import selectors
import sys
from io import RawIOBase

import gimnet


def show_reply(pending: gimnet.Pending) -> None:
    try:
        print(pending.receive(timeout=0).text, flush=True)
    except gimnet.GimnetError as error:
        print(error, flush=True)


def main(speeds: RawIOBase) -> None:
    with gimnet.connect() as node, selectors.PollSelector() as selector:
        # Each source is readable while it has something. Standard input is so only without a buffer.
        pose = node.subscribe("robot/pose")
        selector.register(pose, selectors.EVENT_READ)
        selector.register(speeds, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is pose:
                    print(pose.receive(timeout=0).text, flush=True)
                elif key.fileobj is speeds:
                    line = speeds.readline()
                    if not line:
                        return
                    pending = node.request_later("robot/speed", line.decode().strip())
                    selector.register(pending, selectors.EVENT_READ)
                elif isinstance(key.fileobj, gimnet.Pending):
                    selector.unregister(key.fileobj)
                    show_reply(key.fileobj)


try:
    main(open(0, "rb", buffering=0))
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"poll_loop: {error}")
