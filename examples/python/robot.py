"""A robot to drive from afar: takes commands, gives its pose and pictures. See pilot.py.

A command is a text, `SPEED TURN`, in m/s and rad/s. Half a second without one stops the robot.
"""

import math
import sys
import time

import gimnet

PERIOD, DEAD_MAN, PICTURE_PERIOD = 0.05, 0.5, 0.2


class Robot:
    def __init__(self) -> None:
        self.x = self.y = self.heading = self.speed = self.turn = 0.0

    def obey(self, command: str) -> None:
        try:
            self.speed, self.turn = (float(word) for word in command.split())
        except ValueError:
            print(f"robot: {command!r} is no command", file=sys.stderr)

    def move(self, seconds: float) -> None:
        self.heading += self.turn * seconds
        self.x += self.speed * math.cos(self.heading) * seconds
        self.y += self.speed * math.sin(self.heading) * seconds


def main() -> None:
    with gimnet.connect("robot") as node:
        # Only the newest command, pose and picture count: what is older never waits before them.
        drive = node.accept("drive", queue=1)
        pose = node.advertise("pose", delivery="latest")
        camera = node.advertise("camera", delivery="latest")
        robot = Robot()
        moved = commanded = pictured = time.monotonic()
        while not node.state().ended:
            try:
                command = drive.receive(PERIOD).text  # the period of the loop, or a command at once
            except gimnet.Timeout:
                command = ""
            now = time.monotonic()
            robot.move(now - moved)
            moved = now
            if command:
                robot.obey(command)
                commanded = now
            elif now - commanded > DEAD_MAN:
                robot.obey("0 0")
            pose.publish(f"x {robot.x:f} y {robot.y:f} heading {robot.heading:f}")
            # A camera that nobody watches rests.
            if camera.subscribers and now - pictured > PICTURE_PERIOD:
                pictured = now
                camera.publish(bytes([int(robot.x) % 256]) * (320 * 240))


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"robot: {error}")
