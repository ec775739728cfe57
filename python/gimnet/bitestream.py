"""Dictionaries as Bitestreams and back: docs/bitestream.md. Pure functions, safe in every thread.

A key is a text of 1 to 255 bytes or a number below 2**24. A value is a bool, int, float, str, bytes,
Time, dict, or a list of bools, of ints, of floats or of Times. A Bitestream has no empty values, and
no lists of texts: these are refused with a sentence that names the key.
"""

from __future__ import annotations

import struct
from typing import Any, Dict, List, Mapping, Tuple, Type, Union

__all__ = ["BitestreamError", "Time", "decode", "encode"]

DEPTH_MAX = 16
VALUE_BYTES_MAX = 1 << 30
_KEY_NUMBER_MAX = 0xFFFFFF
_KEY_TEXT_MAX = 255
_OPAQUE, _BOOL, _U64, _I64, _F64, _TEXT, _TIME, _NESTED = 0, 1, 5, 9, 11, 12, 13, 14
_ARRAY = 16
# Of each type of a fixed size: the letter by which struct knows it.
_LETTERS = {1: "?", 2: "B", 3: "H", 4: "I", 5: "Q", 6: "b", 7: "h", 8: "i", 9: "q", 10: "f", 11: "d", 13: "q"}
_SCALARS = {kind: struct.Struct("<" + letter) for kind, letter in _LETTERS.items()}
_LENGTHS = (struct.Struct("<B"), struct.Struct("<H"), struct.Struct("<I"))
_EXACT_FLOAT = 1 << 53

Key = Union[str, int]
Value = Any


class BitestreamError(ValueError):
    """A value that a Bitestream cannot say, or bytes that are none."""


class Time(int):
    """Nanoseconds since 1970. It travels as a time, an int as a number."""

    def __repr__(self) -> str:
        return f"Time({int(self)})"


# ---- writing --------------------------------------------------------------------------------------


def encode(values: Mapping[Key, Value]) -> bytes:
    """The values in their order. BitestreamError names the key of what cannot be said."""
    out = bytearray()
    _put_all(out, values, "", 0)
    return bytes(out)


def _put_all(out: bytearray, values: Mapping[Key, Value], path: str, depth: int) -> None:
    for key, value in values.items():
        where = f"{path}[{key!r}]"
        kind, data = _value(value, where, depth)
        if not data:
            raise BitestreamError(f"{where} is empty: a Bitestream has no empty values, leave it out")
        if len(data) > VALUE_BYTES_MAX:
            raise BitestreamError(f"{where} has {len(data)} bytes, and 2**30 are the most")
        size = len(data)
        code = 0 if size < 1 << 8 else 1 if size < 1 << 16 else 2
        key_bit, key_bytes = _key(key, where)
        out.append(kind << 3 | key_bit | code)
        out += key_bytes
        out += _LENGTHS[code].pack(size)
        out += data


def _key(key: Key, where: str) -> Tuple[int, bytes]:
    if isinstance(key, str):
        text = _text(key, where)
        if 1 <= len(text) <= _KEY_TEXT_MAX:
            return 4, bytes((len(text),)) + text
    elif isinstance(key, int) and not isinstance(key, bool) and 0 <= key <= _KEY_NUMBER_MAX:
        return 0, key.to_bytes(3, "little")
    raise BitestreamError(f"{where}: a key is a text of 1 to 255 bytes or a number below 2**24")


def _text(text: str, where: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        raise BitestreamError(f"{where} is not Unicode text: {error}") from None


def _value(value: Value, where: str, depth: int) -> Tuple[int, bytes]:
    if isinstance(value, bool):
        return _BOOL, b"\1" if value else b"\0"
    if isinstance(value, Time):
        return _TIME, _integer(value, _I64, where)
    if isinstance(value, int):
        kind = _I64 if value < 1 << 63 else _U64
        return kind, _integer(value, kind, where)
    if isinstance(value, float):
        return _F64, _SCALARS[_F64].pack(value)
    if isinstance(value, str):
        return _TEXT, _text(value, where)
    if isinstance(value, (bytes, bytearray, memoryview)):
        return _OPAQUE, bytes(value)
    if isinstance(value, Mapping):
        if depth == DEPTH_MAX:
            raise BitestreamError(f"{where} is nested more than {DEPTH_MAX} deep")
        nested = bytearray()
        _put_all(nested, value, where, depth + 1)
        return _NESTED, bytes(nested)
    if isinstance(value, (list, tuple)):
        return _array(value, where)
    if _is_scalar(value):
        return _value(value.item(), where, depth)
    raise BitestreamError(f"{where} is a {type(value).__name__}: a Bitestream has bool, int, float, str, bytes, "
                          "Time, dict, and lists of numbers, bools or Times")


def _integer(value: int, kind: int, where: str) -> bytes:
    try:
        return _SCALARS[kind].pack(value)
    except struct.error:
        raise BitestreamError(f"{where} is {int(value)}: a Bitestream has whole numbers from -2**63 to 2**64 - 1") from None


def _is_scalar(value: Any) -> bool:
    """A number or bool of numpy, which has one of Python as its item(). A long double has none."""
    return bool(getattr(value, "shape", None) == ()) and hasattr(value, "item") and type(value.item()) in (bool, int, float)


def _kind(value: Any) -> Type[Any]:
    """The type of Python that a value in a list counts as."""
    for kind in (bool, Time, int, float):
        if isinstance(value, kind):
            return kind
    return type(value)


def _array(values: Union[List[Value], Tuple[Value, ...]], where: str) -> Tuple[int, bytes]:
    kinds = {type(value) for value in values}
    if not kinds <= {bool, Time, int, float}:  # enums, numbers of numpy
        values = [value.item() if _is_scalar(value) else value for value in values]
        kinds = {_kind(value) for value in values}
    if kinds <= {bool}:
        kind = _BOOL
    elif kinds <= {Time}:
        kind = _TIME
    elif kinds <= {int}:
        kind = _U64 if max(values) >= 1 << 63 else _I64
    elif kinds <= {int, float} and all(abs(value) <= _EXACT_FLOAT for value in values if isinstance(value, int)):
        kind = _F64
    else:
        names = ", ".join(sorted(kind.__name__ for kind in kinds))
        raise BitestreamError(f"{where} is a list of {names}: a Bitestream has lists of bools, of ints, of floats or of Times")
    try:
        return kind | _ARRAY, struct.pack(f"<{len(values)}{_LETTERS[kind]}", *values)
    except struct.error:
        raise BitestreamError(f"{where}: no type of whole numbers holds all of its values") from None


# ---- reading --------------------------------------------------------------------------------------


def decode(data: Union[bytes, bytearray, memoryview]) -> Dict[Key, Value]:
    """The values by their keys; of several with one key the first. BitestreamError: these bytes are
    no Bitestream."""
    return _take_all(memoryview(data).cast("B"), 0)


def _take_all(data: memoryview, depth: int) -> Dict[Key, Value]:
    values: Dict[Key, Value] = {}
    at, end = 0, len(data)
    while at < end:
        try:
            kind, key, start, at = _head(data, at)
        except (IndexError, struct.error, UnicodeDecodeError):
            raise BitestreamError(f"no Bitestream: value at byte {at} is cut off or has no legal head") from None
        if at > end or start == at:
            raise BitestreamError(f"no Bitestream: value {key!r} is cut off or empty")
        try:
            value = _taken(data[start:at], kind, depth)
        except (struct.error, UnicodeDecodeError, KeyError):
            raise BitestreamError(f"no Bitestream: value {key!r} does not have the form of type {kind}") from None
        values.setdefault(key, value)
    return values


def _head(data: memoryview, at: int) -> Tuple[int, Key, int, int]:
    """Type, key, and where the value begins and ends."""
    head = data[at]
    at += 1
    key: Key
    if head & 4:
        end = at + 1 + data[at]
        key = str(data[at + 1:end], "utf-8")
        if not key or end > len(data):
            raise IndexError
    else:
        end = at + 3
        key = int.from_bytes(data[at:end], "little")
    length = _LENGTHS[head & 3]
    start = end + length.size
    return head >> 3, key, start, start + length.unpack_from(data, end)[0]


def _taken(data: memoryview, kind: int, depth: int) -> Value:
    if kind == _TEXT:
        return str(data, "utf-8")
    if kind == _OPAQUE:
        return bytes(data)
    if kind == _NESTED:
        if depth == DEPTH_MAX:
            raise BitestreamError(f"no Bitestream: nested more than {DEPTH_MAX} deep")
        return _take_all(data, depth + 1)
    element = kind & ~_ARRAY
    if element == _BOOL and max(data) > 1:
        raise KeyError
    if kind & _ARRAY:
        count, rest = divmod(len(data), _SCALARS[element].size)
        if rest:
            raise KeyError
        values = list(struct.unpack(f"<{count}{_LETTERS[element]}", data))
        return [Time(value) for value in values] if element == _TIME else values
    value = _SCALARS[kind].unpack(data)[0]
    return Time(value) if kind == _TIME else value
