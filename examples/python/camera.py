"""A camera with 30 pictures a second, which rests while nobody watches. See viewer.py."""

import sys
import time

import gimnet

WIDTH, HEIGHT = 640, 480


def take(number: int) -> bytearray:
    """A bright line that moves down, a picture after the other."""
    picture = bytearray(b"\x20" * (WIDTH * HEIGHT))
    line = number % HEIGHT * WIDTH
    picture[line:line + WIDTH] = b"\xff" * WIDTH
    return picture


def main() -> None:
    with gimnet.connect("camera") as node:
        images = node.advertise("images", delivery="latest")
        number = 0
        while not node.state().ended:
            if images.subscribers == 0:
                print("camera: nobody watches", flush=True)
                images.wait_for_subscribers(1)
                print("camera: somebody watches", flush=True)
            images.publish(take(number))  # any buffer, so a numpy array too
            number += 1
            time.sleep(0.033)


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"camera: {error}")
