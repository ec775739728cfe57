"""One exception class for each answer of the library; the text is its sentence."""

from __future__ import annotations

from typing import Dict, Type

from . import _c


class GimnetError(Exception):
    """The base of all. `status` is the library's number, also of one that this version does not know.
    Of a request, `ran` says whether the other program may have done the work: no, maybe or yes; and
    `code` is the one that it chose."""

    status = -1
    ran = ""
    code = 0


class Timeout(GimnetError, TimeoutError):
    """The time given was not enough. Try again."""


class Closed(GimnetError):
    """It, or its node, was closed."""


class BadArgument(GimnetError, ValueError):
    """A parameter is outside its range: a mistake of the program."""


class NoHub(GimnetError, ConnectionError):
    """Nothing answers at the hub's address."""


class NoHost(GimnetError, ConnectionError):
    """No address is known for the host in the hub's URL."""


class NotConnected(GimnetError, ConnectionError):
    """The connection is broken at the moment."""


class BadVersion(GimnetError, ConnectionError):
    """The hub speaks another major version of the protocol."""


class NameTaken(GimnetError):
    """Another live node holds the name."""


class BadName(GimnetError, ValueError):
    """The name breaks the rules (docs/protocol.md, section 8)."""


class Refused(GimnetError, ConnectionError):
    """The hub is full, draining, or ended the session."""


class NotFound(GimnetError, LookupError):
    """No node or service of that name."""


class Taken(GimnetError):
    """This node has such a service already."""


class Denied(GimnetError):
    """This node may not do that."""


class Limit(GimnetError):
    """A limit of the hub or of the library was reached."""


class TooLarge(GimnetError, ValueError):
    """The message is larger than allowed."""


class NotDelivered(GimnetError):
    """The message is known not to have arrived."""


class WindowFull(GimnetError):
    """Nothing was sent: as much as the window allows is not acknowledged."""


class Protocol(GimnetError, ConnectionError):
    """The hub sent bytes that docs/protocol.md forbids."""


class System(GimnetError, OSError):
    """The operating system refused, or memory is out."""


class Forked(GimnetError):
    """The object belongs to the parent process: connect anew in the child."""


class NotRetained(GimnetError):
    """The message was published, but is not kept for later subscribers."""


class Busy(GimnetError):
    """Too many requests wait for the program that was asked."""


class Failed(GimnetError):
    """The program that was asked says so, with a `code` of its own."""


class Gone(GimnetError):
    """The program that was asked has ended, or let the request go."""


class Silence(GimnetError):
    """Nothing came for as long as `silence` of subscribe() says."""


class NotTrusted(GimnetError):
    """The hub, or this node, could not prove who it is."""


class NoRight(GimnetError):
    """The rights of this node do not allow that."""


class Expired(GimnetError):
    """The credentials of this node are no longer valid."""


BY_STATUS: Dict[int, Type[GimnetError]] = {
    _c.GIMI_TIMEOUT: Timeout, _c.GIMI_CLOSED: Closed, _c.GIMI_BAD_ARGUMENT: BadArgument, _c.GIMI_NO_HUB: NoHub,
    _c.GIMI_NO_HOST: NoHost, _c.GIMI_NOT_CONNECTED: NotConnected, _c.GIMI_BAD_VERSION: BadVersion,
    _c.GIMI_NAME_TAKEN: NameTaken, _c.GIMI_BAD_NAME: BadName, _c.GIMI_REFUSED: Refused, _c.GIMI_NOT_FOUND: NotFound,
    _c.GIMI_TAKEN: Taken, _c.GIMI_DENIED: Denied, _c.GIMI_LIMIT: Limit, _c.GIMI_TOO_LARGE: TooLarge,
    _c.GIMI_NOT_DELIVERED: NotDelivered, _c.GIMI_WINDOW_FULL: WindowFull, _c.GIMI_PROTOCOL: Protocol,
    _c.GIMI_SYSTEM: System, _c.GIMI_FORKED: Forked, _c.GIMI_NOT_RETAINED: NotRetained,
    _c.GIMI_BUSY: Busy, _c.GIMI_FAILED: Failed, _c.GIMI_GONE: Gone, _c.GIMI_SILENCE: Silence,
    _c.GIMI_NOT_TRUSTED: NotTrusted, _c.GIMI_NO_RIGHT: NoRight, _c.GIMI_EXPIRED: Expired,
}
for _status, _class in BY_STATUS.items():
    _class.status = _status


def error(status: int) -> GimnetError:
    """The exception for a status, with the sentence of this thread's last failed call."""
    made = BY_STATUS.get(status, GimnetError)(_c.lib.gimi_error_text().decode(errors="replace"))
    made.status = status
    return made


def check(status: int) -> None:
    if status != _c.GIMI_OK:
        raise error(status)
