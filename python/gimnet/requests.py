"""Questions to other programs, and their answers."""

from __future__ import annotations

import ctypes
import math
import time
from typing import Any, Dict, Optional

from . import _c, bitestream, errors, messages
from .errand import interruptible
from .handles import PIECE_MS, Handle, NotCopied, Stream, Waitable, end_of, in_pieces, to_text
from .messages import Peer

__all__ = ["Answers", "Pending", "Reply", "Request"]

_ENDED = -1  # no status of the library: the request ended, since its own time was over
_RAN = {_c.GIMI_RAN_NO: "no", _c.GIMI_RAN_MAYBE: "maybe", _c.GIMI_RAN_YES: "yes"}


class _Content:
    """Data of a request or of its reply: a copy."""

    def __init__(self, raw: Any) -> None:
        self.data = memoryview(ctypes.string_at(raw.data, raw.size) if raw.size else b"")
        self.sender = Peer(getattr(raw, "from"))

    @property
    def value(self) -> Dict[bitestream.Key, Any]:
        """The data as a dictionary. BitestreamError: it is no Bitestream."""
        return bitestream.decode(self.data)

    @property
    def text(self) -> str:
        """The data as UTF-8. UnicodeDecodeError."""
        return str(self.data, "utf-8")


class Reply(_Content):
    """The answer of the other program."""


class Pending(Waitable):
    """A request that was asked. Ends with close(), which cancels it here, or when nobody has it."""

    def __init__(self, node: Handle, handle: int) -> None:
        super().__init__(handle)
        self._node = node

    def __enter__(self) -> Pending:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def receive(self, timeout: Optional[float] = None) -> Reply:
        """Waits for the end of the request, which comes once. Timeout with `ran` "": not yet."""
        raw = _c.gimi_reply()

        def call(ms: int) -> int:
            status = int(_c.lib.gimi_wait_for_reply(self._handle, ms, raw))
            return _ENDED if raw.ended and status == _c.GIMI_TIMEOUT else status

        end = end_of(timeout)
        # The first piece without a descriptor, which would cost more than a short request.
        status = in_pieces(PIECE_MS / 1e3 if timeout is None else min(timeout, PIECE_MS / 1e3), call)
        left = end - time.monotonic()
        if status == _c.GIMI_TIMEOUT and left > 0:
            status = self.until(None if left == math.inf else left, call)
        if status == _c.GIMI_TIMEOUT:
            raise errors.Timeout(f"no end of the request within {timeout} s")
        status = _c.GIMI_TIMEOUT if status == _ENDED else status
        try:
            self.check(status)
            return Reply(raw)
        except errors.GimnetError as error:
            if raw.ended:
                error.ran, error.code = _RAN.get(raw.ran, str(raw.ran)), raw.code
            raise
        finally:
            _c.lib.gimi_reply_release(raw)


class Request(_Content, NotCopied):
    """A question of another program. Answer it once; one that is let go is answered with an error."""

    def __init__(self, raw: _c.gimi_request) -> None:
        super().__init__(raw)
        self._raw = raw
        self.left: Optional[float] = raw.left_ms / 1e3 if raw.left_ms >= 0 else None
        """Seconds for which somebody waits for the answer; None: without a limit."""

    def reply(self, value: Any, timeout: float = 1.0) -> None:
        """Closed: it was answered already, or the service has ended."""
        data, size, keeps = messages.payload(value)
        status = in_pieces(timeout, lambda ms: _c.lib.gimi_reply_to(self._raw, data, size, ms))
        del keeps
        errors.check(status)

    def fail(self, code: int, sentence: str = "") -> None:
        """Answers with an error of the program's own; a code is a signed number of 32 bits. Closed."""
        if ctypes.c_int32(code).value != code:
            raise errors.BadArgument(f"the code of an error is -2147483648 to 2147483647, and not {code}")
        words = to_text(sentence)
        interruptible(lambda: errors.check(_c.lib.gimi_fail_request(self._raw, code, words)))

    def __del__(self) -> None:
        _c.lib.gimi_request_release(self._raw)


class Answers(Stream[Request]):
    """The questions to a service that this node answers. Iterating ends when it is closed."""

    def __init__(self, node: Handle, handle: int) -> None:
        super().__init__(handle, kept=True)
        self._node = node

    def receive(self, timeout: Optional[float] = None) -> Request:
        raw = _c.gimi_request()
        self.wait(timeout, lambda ms: _c.lib.gimi_next_request(self._handle, ms, raw))
        return Request(raw)
