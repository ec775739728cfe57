"""docs/bitestream.md: labelled values, read in the order in which they were written."""

import struct

OPAQUE, BOOL, U8, U16, U32, U64, I8, I16, I32, I64, F32, F64, TEXT, TIME, NESTED = range(15)
ARRAY_OF = {17: "?", 18: "B", 19: "H", 20: "I", 21: "Q", 22: "b", 23: "h", 24: "i", 25: "q", 26: "f", 27: "d", 29: "q"}
SCALAR = {BOOL: "?", U8: "B", U16: "H", U32: "I", U64: "Q", I8: "b", I16: "h", I32: "i", I64: "q", F32: "f", F64: "d",
          TIME: "q"}
DEPTH_MAX = 16
VALUE_MAX = 1 << 30


class Broken(ValueError):
    """Bytes that are no Bitestream."""


def put(key, kind, content):
    """One value. `content`: a number, text, a list for an array, bytes for opaque and nested."""
    if kind in SCALAR:
        raw = struct.pack("<" + SCALAR[kind], content)
    elif kind in ARRAY_OF:
        raw = struct.pack(f"<{len(content)}{ARRAY_OF[kind]}", *content)
    else:
        raw = content.encode() if kind == TEXT else bytes(content)
    if not 1 <= len(raw) <= VALUE_MAX:
        raise Broken(f"a value of {len(raw)} bytes")
    size_code = 0 if len(raw) <= 0xFF else 1 if len(raw) <= 0xFFFF else 2
    size = len(raw).to_bytes(1 << size_code, "little")
    if isinstance(key, str):
        name = key.encode()
        return bytes([kind << 3 | 4 | size_code, len(name)]) + name + size + raw
    return bytes([kind << 3 | size_code]) + key.to_bytes(3, "little") + size + raw


def take(stream, depth=0):
    """[(key, type, value)] of a stream; a nested one becomes such a list itself."""
    if depth > DEPTH_MAX:
        raise Broken("nested too deep")
    found, at = [], 0

    def cut(count):
        nonlocal at
        if at + count > len(stream):
            raise Broken("cut off")
        at += count
        return stream[at - count:at]

    while at < len(stream):
        head = cut(1)[0]
        kind, size_code = head >> 3, head & 3
        if size_code == 3:
            raise Broken("size of the length field")
        key = cut(cut(1)[0]).decode() if head & 4 else int.from_bytes(cut(3), "little")
        raw = cut(int.from_bytes(cut(1 << size_code), "little"))
        found.append((key, kind, _value(kind, raw, depth)))
    return found


def _value(kind, raw, depth):
    if not raw:
        raise Broken("a value without bytes")
    try:
        if kind in SCALAR:
            return struct.unpack("<" + SCALAR[kind], raw)[0]
        if kind in ARRAY_OF:
            return list(struct.unpack(f"<{len(raw) // struct.calcsize(ARRAY_OF[kind])}{ARRAY_OF[kind]}", raw))
        if kind == TEXT:
            return raw.decode()
    except (struct.error, UnicodeDecodeError) as error:
        raise Broken(str(error)) from None
    if kind == NESTED:
        return take(raw, depth + 1)
    if kind == OPAQUE:
        return raw
    raise Broken(f"type {kind}")


def fields(stream):
    """{key: value}: of a key that is repeated, the first."""
    found = {}
    for key, _, content in take(stream) if isinstance(stream, (bytes, bytearray)) else stream:
        found.setdefault(key, content)
    return found


def every(stream, wanted):
    """All values of one key."""
    return [content for key, _, content in take(stream) if key == wanted]
