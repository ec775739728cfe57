"""Handles of the library, waiting for them, and the end of the program."""

from __future__ import annotations

import atexit
import ctypes
import math
import numbers
import os
import select
import threading
import time
import weakref
from typing import Any, Callable, Generic, Iterator, NoReturn, Optional, SupportsIndex, Tuple, Type, TypeVar

from . import _c, errors

# A wait without a descriptor is cut into pieces of that length, and Python looks for Ctrl-C between them.
PIECE_MS = 50
TIMEOUT_MS_MAX = (1 << 31) - 1
Got = TypeVar("Got")
Raw = TypeVar("Raw", bound=ctypes.Structure)


def to_ms(seconds: float) -> int:
    """Milliseconds for the options of a call, at least 1. 0 would be the library's default."""
    if not isinstance(seconds, numbers.Real):
        raise TypeError(f"a time is a number of seconds, and this is a {type(seconds).__name__}")
    seconds = float(seconds)  # a number of numpy, which would round what is added to it
    if not 0 <= seconds <= TIMEOUT_MS_MAX / 1000:
        raise errors.BadArgument(f"a time of {seconds} s: use 0 to {TIMEOUT_MS_MAX // 1000}")
    return max(1, round(seconds * 1000))


def check_time(timeout: Optional[float]) -> None:
    """A time that is none is told also if nothing has to be waited for."""
    if timeout is None:
        return
    if not isinstance(timeout, numbers.Real):
        raise TypeError(f"a time is a number of seconds, or None for no limit, and this is a {type(timeout).__name__}")
    if not timeout >= 0:
        raise errors.BadArgument(f"a time of {timeout} s: use 0 or more, or None for no limit")


def end_of(timeout: Optional[float]) -> float:
    """The time at which a wait of so many seconds ends; None: never."""
    check_time(timeout)
    return math.inf if timeout is None else time.monotonic() + float(timeout)


def left_ms(end: float, most: int) -> int:
    """Milliseconds, not more than that; 0: the time is over."""
    left = end - time.monotonic()
    return most if left * 1000 >= most else max(0, math.ceil(left * 1000))


def in_pieces(timeout: Optional[float], call: Callable[[int], Any], last: Optional[Callable[[int], Any]] = None) -> int:
    """Calls with milliseconds until the status is not GIMI_TIMEOUT, or the seconds are over; None: no limit.
    `last`: the call with the rest of the time, after which nobody tries again."""
    check_time(timeout)
    status = int(call(0))
    if status != _c.GIMI_TIMEOUT or timeout == 0:
        return status
    end = end_of(timeout)
    while left_ms(end, 2 * PIECE_MS) == 2 * PIECE_MS:
        status = int(call(PIECE_MS))
        if status != _c.GIMI_TIMEOUT:
            return status
    return int((last or call)(max(1, left_ms(end, 2 * PIECE_MS))))


def to_text(text: str) -> bytes:
    if not isinstance(text, str):
        raise TypeError(f"{text!r} is a {type(text).__name__}, and a str is needed here")
    if "\0" in text:
        raise errors.BadArgument(f"{text!r} has a zero byte")
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        raise errors.BadArgument(f"{text!r} is not Unicode text: {error}") from None


def sized(made: Type[Raw], **members: Any) -> Raw:
    """ctypes would cut numbers that are too large, and take negative ones for large ones."""
    raw = made(struct_size=ctypes.sizeof(made))
    for name, value in members.items():
        try:
            setattr(raw, name, value)
        except TypeError:
            raise TypeError(f"{name} cannot be a {type(value).__name__}: {value!r}") from None
        if isinstance(value, int) and getattr(raw, name) != value:
            raise errors.BadArgument(f"{name} cannot be {value}")
    return raw


def to_key(key: Tuple[int, int]) -> _c.gimi_key:
    try:
        kind, instance = key
        raw = _c.gimi_key(kind, instance)
    except (TypeError, ValueError):
        raise TypeError(f"a key is a type and an instance, two numbers such as (1, 0), and this is {key!r}") from None
    if (raw.type, raw.instance) != (kind, instance):
        raise errors.BadArgument(f"the numbers of a key are 0 to 2**32 - 1, and these are {key!r}")
    return raw


class NotCopied:
    """What ends with its last object, which a copy would end too early."""

    def __reduce_ex__(self, _: SupportsIndex) -> NoReturn:
        """For the modules copy and pickle."""
        raise TypeError(f"a {type(self).__name__} cannot be copied, or be sent to another process: make one there")


class Process:
    """After each fork the child is another process."""

    forks = 0

    @classmethod
    def begin_anew(cls) -> None:
        cls.forks += 1


class Handle(NotCopied):
    """Ends with close(), or with its node. One that is not `kept` also ends when nobody has it any more.
    Safe in every thread."""

    _handle, _kept = 0, True  # of one that was never made

    def __init__(self, handle: int, kept: bool = False) -> None:
        self._handle = handle
        self._kept = kept
        self._forks = Process.forks

    def close(self) -> None:
        """Ends it; does nothing the second time. Calls that wait in it raise Closed."""
        handle, self._handle = self._handle, 0
        if handle:
            _c.lib.gimi_close(handle)

    def __del__(self) -> None:
        if not self._kept:
            self.close()

    def is_here(self) -> bool:
        """It belongs to this process, and not to its parent."""
        return self._forks == Process.forks

    def check_process(self) -> None:
        """For calls that ask the library nothing, or get no status from it."""
        if self._forks != Process.forks:
            raise errors.Forked(f"this {type(self).__name__} belongs to the parent process: connect anew in the child")

    def check(self, status: int) -> None:
        """A thread that waits while the program ends goes without a word."""
        if status == _c.GIMI_CLOSED and Exit.begun:
            raise SystemExit
        if status == _c.GIMI_CLOSED and not self._handle:
            raise errors.Closed(f"this {type(self).__name__} was closed")
        errors.check(status)


class Joining:
    """Held while a handle joins a set or leaves it, so that it is never seen in between."""

    lock = threading.Lock()

    @classmethod
    def begin_anew(cls) -> None:
        cls.lock = threading.Lock()


os.register_at_fork(after_in_child=Process.begin_anew)
os.register_at_fork(after_in_child=Joining.begin_anew)  # another thread may have held it


class RawSet:
    """A wait set of the library and its descriptor, which are closed when nobody has it any more: not while a
    thread polls it, for another thread may be given the same descriptor at once."""

    def __init__(self) -> None:
        made, descriptor = ctypes.c_uint64(), ctypes.c_int32()
        errors.check(_c.lib.gimi_wait_set_create(made))
        self.handle = made.value
        errors.check(_c.lib.gimi_wait_set_descriptor(made, descriptor))
        self.descriptor = descriptor.value

    def __del__(self) -> None:
        if hasattr(self, "handle"):
            _c.lib.gimi_close(self.handle)

    def poll(self, ms: int) -> None:
        """Until the descriptor is readable. Python sees Ctrl-C meanwhile, also if it comes just before a piece."""
        poll = select.poll()
        poll.register(self.descriptor, select.POLLIN)
        end = time.monotonic() + ms / 1e3
        while not poll.poll(min(ms, 2 * PIECE_MS)) and ms > 0:
            ms = left_ms(end, TIMEOUT_MS_MAX)

    def wake(self) -> None:
        """Its descriptor is readable until unwake()."""
        _c.lib.gimi_wait_set_wake(self.handle)

    def unwake(self) -> None:
        _c.lib.gimi_wait_set_wait(self.handle, _c.gimi_ready(), 1, ctypes.sizeof(_c.gimi_ready), 0, ctypes.c_size_t())


class Waitable(Handle):
    """A handle from which something comes: wait for it with receive(), with others in a WaitSet, or in select,
    poll and asyncio by its fileno()."""

    def __init__(self, handle: int, kept: bool = False) -> None:
        super().__init__(handle, kept)
        self._set: Optional[RawSet] = None  # of this handle alone, once a thread waits
        self.shared = False  # the program waits by a descriptor or a WaitSet: nothing is fetched ahead

    @property
    def number(self) -> int:
        """The library's; 0 after close()."""
        return self._handle

    def own_set(self) -> Optional[RawSet]:
        """None: it, or another handle of the same queue, is in a WaitSet."""
        own = self._set
        if own is not None or self.shared:
            return own
        with Joining.lock:
            if self._set is None and not self.shared:
                made = RawSet()
                status = _c.lib.gimi_wait_set_add(made.handle, self._handle, 0)
                if status != _c.GIMI_TAKEN:
                    self.check(status)
                    self._set = made
                    self.check(_c.GIMI_OK if self._handle else _c.GIMI_CLOSED)  # close() did not see the set
            return self._set

    def leave_own_set(self) -> None:
        """For a WaitSet, which holds Joining.lock. Taken: the program waits by fileno()."""
        if self.shared:
            raise errors.Taken("it is in a wait set already, or has a fileno(): wait for it in one way")
        self.shared = True
        own, self._set = self._set, None
        if own is not None:
            _c.lib.gimi_wait_set_remove(own.handle, self._handle)
            own.wake()  # a thread that waits by it goes on in another way

    def has_ready(self) -> bool:
        """Something was fetched ahead."""
        return False

    def fileno(self) -> int:
        """A descriptor that is readable while receive(0) gives something, for select, poll and asyncio. Read
        nothing from it, and do not close it. Taken: it is in a WaitSet, which has a fileno() itself."""
        self.check_process()
        own = self.own_set()
        if own is None:
            raise errors.Taken("it is in a wait set already: use the fileno() of that")
        if self.has_ready() and not self.shared:
            own.wake()
        self.shared = True
        return own.descriptor

    def close(self) -> None:
        super().close()
        if self._set is not None:
            self._set.wake()

    def wait(self, timeout: Optional[float], call: Callable[[int], Any]) -> None:
        """Timeout names the whole time, and the library only its last piece."""
        status = self.until(timeout, call)
        if status == _c.GIMI_TIMEOUT:
            raise errors.Timeout(f"nothing came within {timeout} s")
        self.check(status)

    def until(self, timeout: Optional[float], call: Callable[[int], Any]) -> int:
        """The status of the call when it is not GIMI_TIMEOUT, or the time is over."""
        check_time(timeout)
        status = int(call(0))
        if status != _c.GIMI_TIMEOUT:
            return status
        end = end_of(timeout)
        while status == _c.GIMI_TIMEOUT:
            left = left_ms(end, TIMEOUT_MS_MAX)
            if left <= 0:
                break
            own = self.own_set()
            if own is None:
                return in_pieces(None if end == math.inf else max(0.0, end - time.monotonic()), call)
            own.poll(left)
            status = int(call(0))
        return status


class Stream(Waitable, Generic[Got]):
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
    """Closes all nodes and wait sets when the program ends, before Python waits for its threads."""

    closed: weakref.WeakValueDictionary[int, Handle] = weakref.WeakValueDictionary()  # nodes and sets
    begun = False

    @classmethod
    def add(cls, number: int, made: Handle) -> None:
        cls.closed[number] = made
        if cls.begun:
            made.close()

    @classmethod
    def run(cls) -> None:
        cls.begun = True
        for reference in cls.closed.valuerefs():  # a copy: other threads add theirs
            made = reference()
            if made is not None:
                made.close()


# concurrent.futures ends its threads in the same way: atexit comes after the wait for them.
getattr(threading, "_register_atexit", atexit.register)(Exit.run)
