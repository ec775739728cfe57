"""Calls that wait in the library, made so that Ctrl-C ends them."""

from __future__ import annotations

import _thread
import threading
from typing import Callable, Optional

from .handles import PIECE_MS, Exit

__all__ = ["interruptible"]


class _Errand:
    """A call that a thread makes for the main thread, which Ctrl-C interrupts meanwhile. It is not cut into
    pieces, since an answer that takes longer than a piece would never come."""

    def __init__(self, call: Callable[[], None], undo: Callable[[], None]) -> None:
        self._call: Optional[Callable[[], None]] = call
        self._undo = undo
        self._error: Optional[BaseException] = None
        self._done, self._decided = _thread.allocate_lock(), _thread.allocate_lock()
        self._done.acquire()

    def make(self) -> None:
        """Both threads ask for _decided: the first one has ended the errand, and the other undoes it."""
        call, self._call = self._call, None
        try:
            if call is not None:
                call()
        except BaseException as error:
            self._error = error
        del call  # it has handles, which may end before this thread
        if self._decided.acquire(False):
            self._done.release()
        else:
            self._undo()

    def wait(self) -> None:
        """Begins the thread, and raises what the call raised."""
        undo = self._undo
        try:
            try:
                _thread.start_new_thread(self.make, ())
            except RuntimeError:  # there are too many threads, or Python ends
                self.make()
            # In pieces: a signal that comes just before the lock waits would not end that wait.
            while not self._done.acquire(timeout=PIECE_MS / 1e3):
                pass
        except BaseException:
            if not self._decided.acquire(False):
                undo()
            raise
        error, self._error = self._error, None
        if error is not None:
            try:
                raise error.with_traceback(None)
            finally:
                del error  # its traceback has this frame


def _nothing() -> None:
    """There is nothing to be undone."""


def interruptible(call: Callable[[], None], undo: Callable[[], None] = _nothing) -> None:
    """Makes a call that waits in the library. If Ctrl-C ends the wait, the call goes on in another thread, and
    then `undo` follows, which has no reference to a handle of Python."""
    if Exit.begun or threading.get_ident() != threading.main_thread().ident:
        call()  # Python runs signal handlers in its main thread only
    else:
        _Errand(call, undo).wait()
