"""Waiting for many things with one thread."""

from __future__ import annotations

import ctypes
from typing import Any, Dict, List, Optional, Tuple

from . import _c, errors
from .handles import TIMEOUT_MS_MAX, Exit, Handle, Joining, RawSet, Waitable, end_of, left_ms

__all__ = ["WaitSet"]

_READY_MAX = 64


class WaitSet(Handle):
    """Subscriptions, accepted services, answering services, watches, pending requests, publishers and nodes, of
    which wait() tells those that have something, again and again until it was taken. Each is in at most one set."""

    def __init__(self) -> None:
        raw = RawSet()
        self._raw: Optional[RawSet] = raw
        super().__init__(raw.handle)
        self._members: Dict[int, Tuple[Waitable, Any]] = {}
        self._ahead: Dict[int, Tuple[Waitable, Any]] = {}  # of them, those that fetched ahead before they came
        Exit.add(self._handle, self)

    def __enter__(self) -> WaitSet:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def add(self, source: Waitable, value: Any = None) -> None:
        """`value` is what wait() gives for it; None: itself. Taken: it is in a set; Closed."""
        if not isinstance(source, Waitable):
            raise TypeError(f"nothing is received from a {type(source).__name__}: add a subscription, a service, a watch, ...")
        with Joining.lock:
            source.leave_own_set()
            status = _c.lib.gimi_wait_set_add(self._handle, source.number, source.number)
            source.shared = status == _c.GIMI_OK
        self.check(status)
        self._members[source.number] = member = (source, source if value is None else value)
        if source.has_ready():
            self._ahead[source.number] = member

    def remove(self, source: Waitable) -> None:
        """No wait() will give it any more. NotFound: it is not in this set."""
        number = next((number for number, (member, _) in self._members.items() if member is source), None)
        if number is None:
            raise errors.NotFound("that is not in this wait set")
        _c.lib.gimi_wait_set_remove(self._handle, number)  # fails if it was closed
        source.shared = False
        del self._members[number]
        self._ahead.pop(number, None)

    def wait(self, timeout: Optional[float] = None) -> List[Any]:
        """Waits until members have something, and gives at most 64 of them; ask them with receive(0), another
        thread may have been faster. []: wake() was called. Timeout, Closed."""
        ahead = self._fetched_ahead()
        if ahead:
            return ahead
        ready, count = (_c.gimi_ready * _READY_MAX)(), ctypes.c_size_t()
        end, raw, status = end_of(timeout), self._raw, _c.GIMI_CLOSED
        while raw is not None:
            status = _c.lib.gimi_wait_set_wait(raw.handle, ready, _READY_MAX, ctypes.sizeof(_c.gimi_ready), 0, count)
            if self._raw is None:
                raw.wake()  # the next thread that waits
                status = _c.GIMI_CLOSED
            left = left_ms(end, TIMEOUT_MS_MAX) if status == _c.GIMI_TIMEOUT else 0
            if left <= 0:
                break
            raw.poll(left)
        if status == _c.GIMI_TIMEOUT:
            raise errors.Timeout(f"nothing came within {timeout} s")
        self.check(status)
        told = (self._members.get(one.member) for one in ready[:count.value])
        return [member[1] for member in told if member is not None]

    def _fetched_ahead(self) -> List[Any]:
        for number, (source, _) in list(self._ahead.items()):
            if not source.has_ready():
                self._ahead.pop(number, None)
        return [value for _, value in self._ahead.values()]

    def wake(self) -> None:
        """One wait() ends at once: one that waits, or else the next."""
        self.check(_c.lib.gimi_wait_set_wake(self._handle))

    def fileno(self) -> int:
        """A descriptor for select, poll and asyncio: readable while wait(0) gives something. Read nothing from it,
        and do not close it."""
        self.check_process()
        raw = self._raw
        if raw is None:
            raise errors.Closed("the wait set was closed")
        return raw.descriptor

    def close(self) -> None:
        """Threads that wait raise Closed. Its members are in no set then."""
        self._handle, raw, self._raw = 0, self._raw, None
        if raw is None:
            return
        for number, (source, _) in list(self._members.items()):
            _c.lib.gimi_wait_set_remove(raw.handle, number)
            source.shared = False
        self._members.clear()
        self._ahead.clear()
        raw.wake()
