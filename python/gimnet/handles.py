"""Handles of the library, waiting for it, and the end of the program."""

from __future__ import annotations

import atexit
import ctypes
import math
import threading
import time
import weakref
from typing import Any, Callable, Generic, Iterator, Optional, Type, TypeVar

from . import _c, errors

# The library waits in pieces of that length, and Python looks for Ctrl-C between them.
PIECE_MS = 50
TIMEOUT_MS_MAX = (1 << 31) - 1
Got = TypeVar("Got")
Raw = TypeVar("Raw", bound=ctypes.Structure)


def to_ms(seconds: float) -> int:
    """Milliseconds for the options of a call, at least 1. 0 would be the library's default."""
    if not 0 <= seconds <= TIMEOUT_MS_MAX / 1000:
        raise errors.BadArgument(f"a time of {seconds} s: use 0 to {TIMEOUT_MS_MAX // 1000}")
    return max(1, round(seconds * 1000))


def in_pieces(timeout: Optional[float], call: Callable[[int], Any], ended: Callable[[], bool] = lambda: False) -> int:
    """Calls with milliseconds until the status is not GIMI_TIMEOUT, or that is the end, or the seconds are
    over; None: no limit."""
    status = int(call(0))
    if status != _c.GIMI_TIMEOUT or ended():
        return status
    if timeout is not None and not timeout >= 0:
        raise errors.BadArgument(f"a time of {timeout} s: use 0 or more, or None for no limit")
    end = None if timeout is None else time.monotonic() + timeout
    while status == _c.GIMI_TIMEOUT and not ended():
        left = PIECE_MS if end is None else min(PIECE_MS, math.ceil((end - time.monotonic()) * 1000))
        if left <= 0:
            break
        status = int(call(left))
    return status


def to_text(text: str) -> bytes:
    if "\0" in text:
        raise errors.BadArgument(f"{text!r} has a zero byte")
    return text.encode()


def sized(made: Type[Raw], **members: Any) -> Raw:
    return made(struct_size=ctypes.sizeof(made), **members)


class Handle:
    """Ends with close(), or with its node. One that is not `kept` also ends when nobody has it any more.
    Safe in every thread."""

    def __init__(self, handle: int, kept: bool = False) -> None:
        self._handle = handle
        self._kept = kept

    def close(self) -> None:
        """Ends it; does nothing the second time. Calls that wait in it raise Closed."""
        handle, self._handle = self._handle, 0
        if handle:
            _c.lib.gimi_close(handle)

    def __del__(self) -> None:
        if not self._kept:
            self.close()

    def check(self, status: int) -> None:
        """A thread that waits while the program ends goes without a word."""
        if status == _c.GIMI_CLOSED and Exit.begun:
            raise SystemExit
        errors.check(status)

    def wait(self, timeout: Optional[float], call: Callable[[int], Any]) -> None:
        """Timeout names the whole time, and the library only its last piece."""
        status = in_pieces(timeout, call)
        if status == _c.GIMI_TIMEOUT:
            raise errors.Timeout(f"nothing came within {timeout} s")
        self.check(status)


class Stream(Handle, Generic[Got]):
    """What is received one after the other. Iterating ends when it is closed."""

    def receive(self, timeout: Optional[float] = None) -> Got:
        """Waits for the next one; None: without a limit. Timeout, Closed."""
        raise NotImplementedError

    def __iter__(self) -> Iterator[Got]:
        try:
            while True:
                yield self.receive()
        except errors.Closed:
            return


class Exit:
    """Closes all nodes when the program ends, before Python waits for its threads."""

    nodes: weakref.WeakSet[Handle] = weakref.WeakSet()
    begun = False

    @classmethod
    def run(cls) -> None:
        cls.begun = True
        for node in list(cls.nodes):
            node.close()


# concurrent.futures ends its threads in the same way: atexit comes after the wait for them.
getattr(threading, "_register_atexit", atexit.register)(Exit.run)
