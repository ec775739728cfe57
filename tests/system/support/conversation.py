"""Recorded conversations (tests/vectors/conversation): files of lines `WHO > HEX` for a frame, or the opening, that a node
sent, and `WHO < HEX` for one from the hub, in an order in which they can be played again. `00*500` stands for 500 such
bytes, `WHO x` for a connection that breaks without a word, as the hub has seen when the next line comes. `#` begins a
comment."""

import dataclasses
import re
import struct

from support.wire import (BROADCAST, CTRL, FLAG_EXT, FLOW, GOODBYE, GROUP, HEADER, HELLO, LINK, LIST, NS, OPENING, PING, PONG,
                          REPORT, SERVICE, TAKEN, UNICAST, WELCOME)

NESTED = 14
TRACE = 1  # extension: u16 of all, u8 type, u8 size, u32 slots used; of a slot u32 hub, u32 0, then two times
AGE = 2  # extension: u8 type, u8 size, i64 origin, u32 longest age
KINDS = {UNICAST: "UNICAST", GROUP: "GROUP", LIST: "LIST", BROADCAST: "BROADCAST", SERVICE: "SERVICE", REPORT: "REPORT",
         FLOW: "FLOW", TAKEN: "TAKEN", LINK: "LINK", NS: "NS", CTRL: "CTRL"}

OPERATIONS = {
    LINK: {1: "HELLO", 2: "WELCOME", 3: "GOODBYE"},
    NS: {1: "REGISTER", 2: "UNREGISTER", 3: "RESOLVE", 4: "REVERSE", 5: "LIST", 6: "WATCH", 7: "ADVERTISE", 8: "WITHDRAW",
         9: "SERVICES", 10: "SUBSCRIBE", 11: "UNSUBSCRIBE", 12: "UNWATCH", 13: "WATCH_TAKEN", 32: "SERVICE_MOVED",
         33: "SUBSCRIBERS", 37: "WATCH_EVENTS"},
    CTRL: {1: "HUB_INFO", 2: "STATISTICS", 3: "CONNECTIONS", 4: "KICK", 5: "REASSIGN", 6: "DRAIN", 7: "RELOAD",
           8: "LOG_LEVEL", 9: "HUBS", 10: "LINKS", 11: "LINK_ADD", 12: "LINK_REMOVE",
           13: "LINK_COST"},
}
FLOWS = ("", "PING", "PONG", "CREDIT", "PAUSE", "RESUME", "CONFIRM", "SKIP", "DROPPED")

# What is another one each time: (kind, operation): paths of keys. Sentences are for people, and may be put in other words.
# Keys 15 of WELCOME and 4 of REGISTER's answer said that a name is not provisional: no name is any more.
VOLATILE = {
    (LINK, HELLO): {(3,), (4,)},
    (LINK, WELCOME): {(2,), (5,), (7,), (10,), (15,), (17,)},  # 7: a later hub offers more features
    (LINK, GOODBYE): {(2,)},
    (NS, 0x8001): {(4,), (5,)},
    (NS, 0x8002): {(5,)},
    (NS, 0x8005): {(3, 7), (3, 8)},
    (NS, 0x8007): {(5,)},
    (NS, 37): {(6,), (3, 4, 7), (3, 4, 8)},
    (CTRL, 0x8001): {(5,), (7,)},
    (CTRL, 0x8002): {(3,)},
    (CTRL, 0x8003): {(3, 5), (3, 7), (3, 11)},  # bytes sent: an answer to STATISTICS, longer with each new counter, too
}


@dataclasses.dataclass
class Step:
    """One frame, or an opening, that somebody sent; no bytes: the connection breaks."""

    who: str
    from_hub: bool
    data: bytes

    @property
    def is_opening(self):
        return self.data == OPENING

    @property
    def is_break(self):
        return not self.data

    @property
    def kind(self):
        return self.data[12]

    @property
    def operation(self):
        return struct.unpack_from("<H", self.data, HEADER)[0]

    def words(self):
        if self.is_opening:
            return "the opening"
        if self.is_break:
            return "the connection breaks"
        name = KINDS.get(self.kind, str(self.kind))
        if self.kind in (LINK, NS, CTRL):
            operation, request = struct.unpack_from("<HH", self.data, HEADER)
            what = OPERATIONS[self.kind].get(operation & 0x7FFF, f"operation {operation & 0x7FFF}")
            numbered = f", request {request}" if request else ""
            return f"{name}, {'answer to ' if operation & 0x8000 else ''}{what}{numbered}"
        if self.kind == FLOW:
            return f"FLOW, {FLOWS[self.data[HEADER]]}"
        return f"{name}, {len(self.data) - HEADER} bytes"


def is_keep_alive(data, from_hub):
    """The hub's PING and the answer to it come when they want: no part of what was said."""
    return data != OPENING and data[12] == FLOW and data[HEADER] == (PING if from_hub else PONG)


def load(path):
    steps = []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split("#")[0].split()
        for index, word in enumerate(words):
            byte, _, count = word.partition("*")
            words[index] = byte * int(count) if count else word
        if words:
            steps.append(Step(words[0], words[1] == "<", bytes.fromhex("".join(words[2:]))))
    return steps


def short(data):
    """Hex digits; long runs of one byte as 00*500."""
    words, end = [], 0
    for run in re.finditer(rb"(?s)(.)\1{63,}", data):
        words += [data[end:run.start()].hex(), f"{run[1].hex()}*{len(run[0])}"]
        end = run.end()
    return " ".join(word for word in (*words, data[end:].hex()) if word)


def save(path, title, steps):
    lines = [f"# {line}" for line in title.splitlines()]
    for step in steps:
        if step.is_break:
            lines += [f"# {step.who}: {step.words()}", f"{step.who} x"]
            continue
        header = step.data[:HEADER].hex(" ", 4)
        body = short(step.data[HEADER:])
        sign = "<" if step.from_hub else ">"
        lines += [f"# {step.who} {'is told' if step.from_hub else 'says'}: {step.words()}",
                  f"{step.who} {sign} {step.data.hex()}" if step.is_opening else f"{step.who} {sign} {header} {body}".rstrip()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def values(stream):
    """[(key, type, content)]; the content of a nested value is such a list."""
    found, at = [], 0
    while at < len(stream):
        head, key = stream[at], int.from_bytes(stream[at + 1:at + 4], "little")
        size_bytes = 1 << (head & 3)
        size = int.from_bytes(stream[at + 4:at + 4 + size_bytes], "little")
        at += 4 + size_bytes
        content = stream[at:at + size]
        at += size
        found.append((key, head >> 3, values(content) if head >> 3 == NESTED else content))
    return found


def without(content, volatile, path=()):
    """The same without the values at the volatile paths, and without the sentence of an answer that says no."""
    kept = []
    for key, kind, value in content:
        here = (*path, key)
        if here in volatile:
            continue
        kept.append((key, kind, without(value, volatile, here) if kind == NESTED else value))
    return kept


def without_origin(body):
    """The body with zeros in place of the origin of its AGE extension."""
    end = 2 + int.from_bytes(body[:2], "little")
    at = 2
    while at + 2 <= end:
        size = body[at + 1]
        if body[at] == AGE and size == 12:
            return body[:at + 2] + bytes(8) + body[at + 10:]
        at += 2 + size
    return body


def without_times(step):
    """The body without the times that the hub writes: into a PONG, into the first slot of a TRACE that stands in front,
    and into an AGE whose origin is in the future, as it is in the recordings."""
    body = step.data[HEADER:]
    if step.kind == FLOW and body[0] == PONG:
        return body[:16]
    if step.kind != FLOW and step.data[13] & FLAG_EXT:
        body = without_origin(body)
    if step.kind != FLOW and step.data[13] & FLAG_EXT and body[2] == TRACE:
        return body[:16] + bytes(16) + body[32:]
    return body


def stable(step):
    """What has to be the same each time: header without the length, and the values that are not volatile."""
    if step.is_opening:
        return "opening", [], step.data[:6]
    header = step.data[4:HEADER]
    if step.kind not in (LINK, NS, CTRL):
        return header, [], without_times(step)
    operation = step.operation
    volatile = set(VOLATILE.get((step.kind, operation), ()))
    content = values(step.data[HEADER + 4:])
    refused = operation & 0x8000 and content and content[0][0] == 1 and int.from_bytes(content[0][2], "little") != 0
    if refused:
        volatile.add((2,))
    return header, without(content, volatile), step.data[HEADER:HEADER + 4]


def covers(now, recorded):
    """Is all of the recorded in what comes now? Keys that came later may stand beside it."""
    remaining = list(now)
    for key, kind, value in recorded:
        for index, (other_key, other_kind, other) in enumerate(remaining):
            if other_key == key and other_kind == kind and (covers(other, value) if kind == NESTED else other == value):
                del remaining[:index + 1]
                break
        else:
            return False
    return True
