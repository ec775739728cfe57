"""A robot with one thread: publishes where it is ten times a second, and answers the question
robot/speed by driving as fast as the question says. See poll_loop.py."""

import sys
import time

import gimnet

PERIOD = 0.1


def main() -> None:
    x = speed = 0.0
    with gimnet.connect("robot") as node, gimnet.WaitSet() as waits:
        pose = node.advertise("pose", delivery="latest")
        speeds = node.answer("speed")
        waits.add(speeds)  # more members: subscriptions, accepted services, watches, ...
        due = time.monotonic() + PERIOD
        while not node.state().ended:
            try:
                waits.wait(timeout=max(0.0, due - time.monotonic()))
                request = speeds.receive(timeout=0)
                try:
                    speed = float(request.text)
                    request.reply(f"speed {speed:f}")
                except ValueError:
                    request.fail(1, f"'{request.text}' is no speed")
            except gimnet.Timeout:
                due += PERIOD
                x += speed * PERIOD
                pose.publish(f"x {x:f}")  # False while the hub is away


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"wait_set: {error}")
