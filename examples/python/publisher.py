"""Publishes ten times a second where a robot is: see subscriber.py."""

import sys
import time

import gimnet


def main() -> None:
    with gimnet.connect("robot") as node:  # joins by the hub of this machine, or of GIMNET_HUB
        odometry = node.advertise("odom")  # its full name is robot/odom
        step = 0
        while not node.state().ended:
            # False: the hub is away. The next message is newer.
            if not odometry.publish(f"x {0.1 * step:f} y 0"):
                print("publisher: not sent:", node.state().trouble, file=sys.stderr)
            step += 1
            time.sleep(0.1)
    sys.exit("publisher: no connection will come any more")


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"publisher: {error}")  # what happened, to what, and what to do
