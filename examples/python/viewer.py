"""Watches camera.py: viewer.py [MS], which takes so long for each picture. It always shows the
newest one, and skips those that came meanwhile."""

import sys
import time

import gimnet


def main() -> None:
    work = float(sys.argv[1]) / 1000 if len(sys.argv) > 1 else 0.5
    with gimnet.connect() as node:
        images = node.subscribe("camera/images", newest_only=True)
        for picture in images:  # picture.array("u1", (480, 640)) is a numpy array without a copy
            print(f"picture {picture.sequence}, {len(picture.data)} bytes, {images.missed} skipped", flush=True)
            time.sleep(work)


try:
    main()
except KeyboardInterrupt:
    pass
except gimnet.GimnetError as error:
    sys.exit(f"viewer: {error}")
