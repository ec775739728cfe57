"""Drives robot.py from afar and shows where it is and what it sees: pilot.py [SPEED TURN [SECONDS]]"""

import sys
import time

import gimnet


def main() -> None:
    words = sys.argv[1:]
    command = f"{words[0]} {words[1]}" if len(words) >= 2 else "0.5 0.1"
    end = time.monotonic() + (float(words[2]) if len(words) >= 3 else 5.0)
    with gimnet.connect("pilot") as node:
        poses = node.subscribe("robot/pose")
        pictures = node.subscribe("robot/camera", newest_only=True)
        while time.monotonic() < end:
            # The robot stops by itself if commands no longer reach it, so each is sent again and again.
            try:
                node.send("robot/drive", command, timeout=0.1)
                print(poses.receive(timeout=0.2).text, flush=True)
            except gimnet.GimnetError as error:
                print("pilot:", error, file=sys.stderr)
            try:
                picture = pictures.receive(timeout=0)
                print(f"picture {picture.sequence}, {len(picture.data)} bytes", flush=True)
            except gimnet.Timeout:
                pass


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"pilot: {error}")
