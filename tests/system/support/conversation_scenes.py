"""What version_1.txt does not have: scenes that are recorded, each in a file of its own, and played again."""

import dataclasses
import struct
import typing

from support.wire import (BLOCK, CONFIRM, CTRL, DROP, FLAG_EXT, FLAG_FRAGMENT, FLAG_REPORT, FLOW, LINK, OPENING, PAUSE, PONG,
                          REPORT, RESUME, SKIP, TAKEN, hello, number)

TRACE_BYTES, AGE_BYTES = 4 + 24, 12
YEAR_2000_NS, YEAR_2200_NS = 946_684_800 * 10**9, 7_258_118_400 * 10**9


@dataclasses.dataclass
class Scene:
    title: str
    play: typing.Callable
    has: tuple  # words of steps: why the scene is there
    arguments: tuple = ()  # of the hub


def flow(client, operation):
    return client.next_where(lambda got: got.kind == FLOW and got.payload[0] == operation)


def confirm(client, count):
    client.send(client.frame(0, struct.pack("<B7xQ", CONFIRM, count), kind=FLOW))


def resume(stage):
    robot = stage.client("robot").join("robot")
    viewer = stage.client("viewer").join("viewer", extra=number(4, 5, 77) + number(5, 1, True))
    robot.ping()
    flow(robot, PONG)
    robot.send(robot.frame(viewer.id, b"taken"))
    viewer.next_data()
    confirm(viewer, 1)
    # More than the hub keeps: what was first is let go, and announced.
    for count in range(12):
        robot.send(robot.frame(viewer.id, bytes([count]) + bytes(499), flags=DROP))
        viewer.next_data()
    stage.cut(viewer)
    # More than may wait for one who is away.
    for count in range(5):
        robot.send(robot.frame(viewer.id, bytes([100 + count]) + bytes(3999), flags=BLOCK))
    flow(robot, PAUSE)
    again = stage.client("again")
    again.join("viewer", token=viewer.welcome[2],
               extra=number(4, 5, 77) + number(5, 1, True) + number(9, 5, viewer.welcome[5]) + number(10, 5, 1))
    skipped = struct.unpack_from("<Q", flow(again, SKIP).payload, 8)[0]
    for count in range(2 + skipped, 1 + 12 + 5 + 1):
        again.next_data()
        confirm(again, count)
    flow(robot, RESUME)


def data(stage):
    robot = stage.client("robot").join("robot")
    viewer = stage.client("viewer").join("viewer")
    robot.send(robot.frame(viewer.id, b"at once", lane=0))
    viewer.next_data()
    trace = struct.pack("<BBI", 1, TRACE_BYTES, 0) + bytes(24)
    age = struct.pack("<BBqI", 2, AGE_BYTES, YEAR_2200_NS, 1_000)
    for extensions in (trace, age, trace + age + b"\xc8\x02hi"):
        body = struct.pack("<H", len(extensions)) + extensions
        robot.send(robot.frame(viewer.id, body + b"extended", flags=FLAG_EXT))
        viewer.next_data()
    age = struct.pack("<HBBqI", 2 + AGE_BYTES, 2, AGE_BYTES, YEAR_2000_NS, 1_000)
    robot.send(robot.frame(viewer.id, age + b"too old", flags=FLAG_EXT | FLAG_REPORT))
    robot.next_where(lambda got: got.kind == REPORT)
    for offset, part in ((0, b"a mess"), (6, b"age of "), (13, b"parts")):
        robot.send(robot.frame(viewer.id, struct.pack("<III", 9, offset, 18) + part, flags=FLAG_FRAGMENT, lane=2))
        viewer.next_data()
    viewer.send(viewer.frame(robot.id, struct.pack("<III", 9, 18, 1 << 20), kind=TAKEN, lane=0))
    robot.next_where(lambda got: got.kind == TAKEN)


def end(stage):
    robot = stage.client("robot").join("robot")
    rival = stage.client("rival")
    rival.send(OPENING + hello("robot"))
    rival.first_answer()
    admin = stage.client("admin").join(role=2)
    admin.numbered(CTRL, 6)
    for who in (robot, admin):
        who.next_where(lambda got: got.kind == LINK)


SCENES = {
    "resume": Scene("""A node that asked for resume takes much, breaks, and comes back: what it took is confirmed, what the hub let go is
announced, and the sender of what waited meanwhile is paused.""", resume,
                    (">FLOW, PING", "<FLOW, PONG", ">FLOW, CONFIRM", "<FLOW, PAUSE", "<FLOW, RESUME", "<FLOW, SKIP"),
                    ("--limit", "resume_bytes=4096", "--limit", "lane1_bytes=16384")),
    "data": Scene("""Lane 0, extensions, what is too old, and a message in parts with its progress.""", data,
                  ("<UNICAST, 7 bytes", "<TAKEN, 12 bytes", "<REPORT, 44 bytes")),
    "end": Scene("""A name that is held, and a hub that an administrator has drain.""", end,
                 ("<LINK, GOODBYE", ">CTRL, DRAIN, request 1", "<CTRL, answer to DRAIN, request 1")),
}
