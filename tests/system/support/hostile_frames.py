"""Random frames of a node that means no good: what the hub passes on to others, whatever is in them, and some that it
answers by closing the connection. All of them follow from a seed."""

import random
import struct

from support.wire import (BLOCK, BROADCAST, CTRL, DROP, FLAG_EXT, FLAG_FRAGMENT, FLAG_KEYED, FLAG_REPORT, GROUP, HEADER,
                          LATEST, LIST, NS, PING, PONG, REPORT, SERVICE, TAKEN, UNICAST, control, frame, text)

DATA, ACK, REQUEST, REPLY, ERROR, GIMI_PING, GIMI_PONG = range(7)
PAD, TRACE, AGE = range(3)
PAYLOAD_MAX = 60_000
MIB = 1 << 20
EXTREMES = (0, 1, 2, 63, 64, 65, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF)
# Sizes of messages that a library would wait for, allow by TAKEN, or refuse.
TOTALS = (100, 8193, 70_000, MIB, MIB + 1, 5 * MIB, 64 * MIB, 64 * MIB + 2000, 1 << 30, 0xFFFFFFFF)


class Surroundings:
    """What the node knows of the others."""

    def __init__(self):
        self.own_id = 0
        self.nodes = [1]
        self.own_groups = []
        self.groups = [1]
        self.epochs = [0]  # overheard ones


class HostileFrames:
    """Each call of next() makes the bytes of a few frames."""

    def __init__(self, seed, around):
        self.around = around
        self._random = random.Random(seed)
        self._message = 0
        self._recipes = ((self.of_any_kind, 20), (self.taken, 15), (self.gimi, 20), (self.answer, 12), (self.gimi_ping, 8),
                         (self.fragments, 15), (self.extensions, 8), (self.to_subscribers, 20), (self.look_alike, 4),
                         (self.request, 2), (self.broken, 1))

    def next(self):
        recipes, weights = zip(*self._recipes)
        return self._random.choices(recipes, weights)[0]()

    # Values

    def number(self, bits=32):
        if self._random.random() < 0.5:
            return self._random.choice(EXTREMES) & (1 << bits) - 1
        return self._random.getrandbits(self._random.randint(1, bits))

    def size(self, most=PAYLOAD_MAX):
        """Small ones are as likely as large ones."""
        return min(int(2 ** self._random.uniform(0, 16)) - 1, most)

    def junk(self, size=None):
        return self._random.randbytes(self.size() if size is None else size)

    def key(self):
        return struct.pack("<II", *(self._random.choice((0, 0, 0, 1, self.number())) for _ in range(2)))

    def epoch(self):
        return self._random.choice((1, 2, 3, self.number(), self._random.choice(self.around.epochs)))

    def lane(self):
        return self._random.randrange(4)

    # Frames that the hub passes on

    def wrapped(self, payload=b"", kind=UNICAST, dst=None, key=None, fragment=None, extensions=None, lane=None):
        """A frame of a kind that nodes may send, with flags that the kind may carry."""
        around, choose = self.around, self._random.choice
        flags = FLAG_REPORT if self._random.random() < 0.1 else 0
        head = b""
        if kind == LIST:
            ids = sorted({choose(around.nodes) for _ in range(self._random.randint(1, 8))})
            dst, head = len(ids), struct.pack(f"<{len(ids)}I", *ids)
        elif kind == BROADCAST:
            dst = choose((0xFFFFFFFF, around.own_id | 0xFFFFF))
        elif dst is None:
            dst = choose(around.own_groups or around.groups) if kind == GROUP else choose(around.nodes)
            dst = choose(around.groups) if kind == SERVICE else dst
        if extensions is not None:
            flags, head = flags | FLAG_EXT, head + struct.pack("<H", len(extensions)) + extensions
        if fragment is not None:
            flags, head = flags | FLAG_FRAGMENT, head + struct.pack("<III", *fragment)
        if key is not None:
            flags, head = flags | FLAG_KEYED, head + key
        flags |= choose(self._policies(kind, key is not None))
        return frame(dst, around.own_id, head + payload, kind=kind, flags=flags, lane=self.lane() if lane is None else lane)

    @staticmethod
    def _policies(kind, keyed):
        if kind in (GROUP, LIST, BROADCAST):
            return 0, DROP, LATEST
        if kind in (UNICAST, SERVICE) and not keyed:
            return 0, BLOCK, DROP
        return 0, BLOCK, DROP, LATEST

    def of_any_kind(self):
        kind = self._random.choice((UNICAST, GROUP, LIST, BROADCAST, SERVICE, TAKEN, *range(8, 16)))
        return self.wrapped(self.junk(), kind, key=self.key() if self._random.random() < 0.5 else None)

    def taken(self):
        numbers = struct.pack("<III", *(self.number() for _ in range(3)))
        payload = (numbers + self.junk(8))[:self._random.randint(0, 20)]
        return self.wrapped(payload, TAKEN, key=self.key() if self._random.random() < 0.1 else None)

    def header(self, operation, epoch=None, sequence=None, extension=0):
        flags = self._random.choice((0, 1, 2, 3, self.number(8)))
        return struct.pack("<IIBBH", self.epoch() if epoch is None else epoch,
                           self.number() if sequence is None else sequence, operation, flags, extension)

    def gimi(self):
        """A KEYED message with a header of GIMI that is right, cut, or lies."""
        kind = self._random.choice((UNICAST, UNICAST, SERVICE, LIST, BROADCAST))
        operation = self._random.choice((DATA, DATA, DATA, REQUEST, self.number(8)))
        header = self.header(operation, extension=self._random.choice((0, 8, self.number(16))))
        content = header + self.junk()
        if self._random.random() < 0.3:
            content = content[:self._random.randint(0, 24)]
        return self.wrapped(content, kind, key=self.key())

    def answer(self):
        """About a stream of others."""
        operation = self._random.choice((ACK, ACK, REPLY, ERROR, GIMI_PONG))
        group = self._random.choice(self.around.groups)
        if operation == ACK:
            data = struct.pack("<QII", self.number(64), self.number(), group)[:self._random.choice((12, 16, 16, 3, 0))]
        elif operation == ERROR:
            status = self._random.choice((6, 6 | 0x8000, self.number(16)))
            data = struct.pack("<HI", status, group) + self.junk(self.size(1000))
        else:
            data = self.junk(self.size(1000))
        return self.wrapped(self.header(operation, sequence=self._random.choice((1, 2, 3, self.number()))) + data,
                            key=self.key())

    def gimi_ping(self):
        kind = self._random.choice((UNICAST, UNICAST, SERVICE, LIST, BROADCAST))
        return self.wrapped(self.header(GIMI_PING) + self.junk(self._random.choice((8, 0, 7, None))), kind, key=self.key())

    def fragments(self):
        """A message that begins, and goes on as it should, or in another way."""
        choose = self._random.choice
        self._message += 1
        kind, lane = choose((UNICAST, UNICAST, LIST, BROADCAST, GROUP)), self.lane()
        dst = choose(self.around.nodes) if kind == UNICAST else None
        key = choose((None, self.key()))
        total, size = choose(TOTALS), self.size(20_000) + 1
        size = min(size, total)
        content = self.header(DATA) + self.junk(size)
        pieces = [(self._message, 0, total, content[:size])]
        offset = size
        for _ in range(self._random.randrange(5)):
            number = choose((self._message, self._message, self._message, self._message + 1))
            at = choose((offset, offset, offset, offset + 1, max(offset - 1, 0), 0))
            whole = choose((total, total, total, total + 1)) & 0xFFFFFFFF
            piece = self.junk(min(self.size(20_000) + 1, max(whole - at, 0)))
            if not piece:
                break
            pieces.append((number, at, whole, piece))
            offset += len(piece)
        frames = [self.wrapped(piece, kind, dst, key, head, lane=lane) for *head, piece in pieces]
        if self._random.random() < 0.2:
            frames.append(self.wrapped(b"between", kind, dst, key, lane=lane))
        return b"".join(frames)

    def extensions(self):
        chain = b""
        for _ in range(self._random.randrange(6)):
            kind = self._random.choice((PAD, TRACE, TRACE, AGE, AGE, self.number(8)))
            value = self.junk(self._random.choice((0, 4, 12, 28, 52, self.size(255))))
            chain += bytes([kind, len(value)]) + value
        kind = self._random.choice((UNICAST, TAKEN, BROADCAST, LIST, 9))
        return self.wrapped(self.header(DATA) + self.junk(self.size(500)), kind, key=self.key(), extensions=chain)

    def to_subscribers(self):
        """A frame of an own service, or of one that is another's."""
        groups = self.around.own_groups or self.around.groups
        group = self._random.choice(groups if self._random.random() < 0.9 else self.around.groups)
        content = self.header(self._random.choice((DATA, DATA, DATA, self.number(8)))) + self.junk(self.size(2000))
        if self._random.random() < 0.2:
            content = content[:self._random.randint(0, 16)]
        return self.wrapped(content, GROUP, group, self._random.choice((None, self.key(), bytes(8))))

    def look_alike(self):
        """What would be a word of the hub in a frame of another kind."""
        report = bytes([self._random.randrange(24), 0, 0, 0]) + struct.pack("<I", self.number()) + self.junk(36)
        flow = bytes([self._random.choice((PING, PONG, self.number(8))), 0, 0, 0]) + self.junk(20)
        return self.wrapped(self._random.choice((report, flow, control(3, self.junk(30)))),
                            self._random.choice((UNICAST, TAKEN, *range(8, 16))))

    # Frames that the hub answers

    def request(self):
        operation = self._random.choice((1, 3, 5, 7, 8, 9, 10, 11, 33, self.number(16)))
        body = self._random.choice((text(3, "a/b"), self.junk(self.size(100))))
        return frame(0, self.around.own_id, control(operation, body, 1), kind=self._random.choice((NS, CTRL)))

    def broken(self):
        """A header of random bytes, or one field of a good one that is not."""
        good = bytearray(self.wrapped(self.junk(self.size(300))))
        if self._random.random() < 0.5:
            return frame(self.number(), self.around.own_id, self.junk(self.size(300)), kind=self.number(8),
                         flags=self.number(8), lane=self._random.choice((1, self.number(8))))
        good[self._random.randrange(HEADER)] ^= 1 << self._random.randrange(8)
        return bytes(good) + bytes(self.size(100))
