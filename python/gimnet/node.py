"""Nodes, and what they publish, subscribe, accept, send and watch."""

from __future__ import annotations

import collections
import ctypes
from dataclasses import dataclass
from typing import Any, Deque, Dict, Iterator, List, Optional, Set, Tuple, Type, Union

from . import _c, errors, messages
from .errand import interruptible
from .handles import (TIMEOUT_MS_MAX, Exit, Handle, Raw, Stream, Waitable, end_of, in_pieces, left_ms, sized, to_key,
                      to_ms, to_text)
from .messages import Event, Message, NodeRecord, Peer, ServiceRecord
from .requests import Answers, Pending, Reply

__all__ = ["ConnectionEvent", "ConnectionWatch", "Node", "Publisher", "Source", "State", "Watch", "connect"]

_SMALL_BYTES = 1 << 16
_PIECES_BYTES_MAX = 1 << 20  # any receiver takes the whole of a smaller message before it looks at its size


def _peer(to: Peer) -> int:
    if not 0 <= to < 1 << 32:
        raise errors.BadArgument(f"{int(to)} is no node: a Peer is a number from 0 to 2**32 - 1")
    return to


def _close(handle: ctypes.c_uint64) -> None:
    """One that came after Ctrl-C, so that nobody has it."""
    _c.lib.gimi_close(handle)


class Source(Stream[Message]):
    """The messages of a subscription, or of an accepted service. A message counts as taken when
    receive() fetched it. Of streams several are fetched at once."""

    def __init__(self, node: Node, handle: int, kept: bool = False) -> None:
        super().__init__(handle, kept)
        self._node = node  # lives as long as its parts
        self._ready: Deque[Message] = collections.deque()

    def receive(self, timeout: Optional[float] = None) -> Message:
        try:
            message = self._ready.popleft()
        except IndexError:
            pass
        else:
            self.check_process()  # the parent gives the messages that it fetched
            if self.shared and not self._ready and self._set is not None:
                self._set.unwake()
            return message
        batch = _c.gimi_batch()
        most = 1 if self.shared else _c.GIMI_BATCH_MESSAGES_MAX
        self.wait(timeout, lambda ms: _c.lib.gimi_receive_packed(self._handle, most, ms, batch))
        first, *others = messages.unpacked(batch)
        self._ready.extend(others)
        return first

    def has_ready(self) -> bool:
        return bool(self._ready) and self.is_here()

    @property
    def missed(self) -> int:
        """Messages of a subscription that did not come, or were overwritten because nobody took them."""
        counts = sized(_c.gimi_queue_counts)
        self.check(_c.lib.gimi_counts(self._handle, counts))
        return int(counts.missed)


class Watch(Stream[Event]):
    """The nodes and services that match a pattern: first what is there, then what changes."""

    def __init__(self, node: Node, handle: int) -> None:
        super().__init__(handle)
        self._node = node

    def receive(self, timeout: Optional[float] = None) -> Event:
        raw = _c.gimi_watch_event()
        self.wait(timeout, lambda ms: _c.lib.gimi_watch_receive(self._handle, ms, raw))
        try:
            return Event.of(raw)
        finally:
            _c.lib.gimi_watch_event_release(raw)


@dataclass(frozen=True)
class ConnectionEvent:
    """What became of the connection of a node: `change` is connected, lost, resumed (the session goes on),
    connected anew (what was on its way is lost) or ended (none will come any more). `why` is the cause in
    words, with the number of messages that were not sent meanwhile, apart from those of send() with a timeout
    of 0. `when` is in seconds since 1970. `skipped` events before it went, since 64 waited."""

    change: str
    why: str
    when: float
    skipped: int


_CONNECTION_CHANGES = {_c.GIMI_CONNECTED: "connected", _c.GIMI_CONNECTION_LOST: "lost", _c.GIMI_RESUMED: "resumed",
                       _c.GIMI_CONNECTED_ANEW: "connected anew", _c.GIMI_CONNECTION_ENDED: "ended"}


class ConnectionWatch(Stream[ConnectionEvent]):
    """What becomes of the connection of a node. The first event is the one that was the last."""

    def __init__(self, node: Node, handle: int) -> None:
        super().__init__(handle)
        self._node = node

    def receive(self, timeout: Optional[float] = None) -> ConnectionEvent:
        """Timeout, Closed; after the event `ended` why no connection will come."""
        raw = sized(_c.gimi_connection_event)
        self.wait(timeout, lambda ms: _c.lib.gimi_connection_receive(self._handle, ms, raw))
        change = _CONNECTION_CHANGES.get(raw.change, str(raw.change))
        return ConnectionEvent(change, raw.why.decode(errors="replace"), raw.when_ns / 1e9, raw.skipped)


class Publisher(Waitable):
    """A service that this node provides, until close() or the end of the node. A WaitSet, or its fileno(), tells when
    subscribers_changed(0) gives another number."""

    # The program can do nothing about these but go on: the hub is away, or slow.
    _AWAY = (_c.GIMI_TIMEOUT, _c.GIMI_NOT_CONNECTED, _c.GIMI_REFUSED)

    def __init__(self, node: Node, handle: int) -> None:
        super().__init__(handle, kept=True)
        self._node = node

    def publish(self, value: Any, timeout: float = 1.0) -> bool:
        """Sends a dict as a Bitestream, a str as UTF-8, or any buffer. False: dropped, at once while the hub
        is away, or because it did not take it in time. Raises only for mistakes of the program."""
        data, size, keeps = messages.payload(value)
        status = in_pieces(timeout, lambda ms: _c.lib.gimi_publish(self._handle, data, size, ms, 0))
        del keeps
        if status in self._AWAY:
            return False
        if status != _c.GIMI_NOT_RETAINED:  # it was sent
            self.check(status)
        return True

    @property
    def unsent(self) -> int:
        """Messages that were dropped, since the hub was away."""
        self.check_process()
        return int(_c.lib.gimi_unsent(self._handle))

    @property
    def subscribers(self) -> int:
        """Their number, as the hub told last. With 0 nothing is sent."""
        self.check_process()
        return int(_c.lib.gimi_subscribers(self._handle))

    def wait_for_subscribers(self, count: int = 1, timeout: Optional[float] = None) -> None:
        """Timeout, Closed."""
        if not isinstance(count, int):
            raise TypeError(f"subscribers are counted by an int, and this is a {type(count).__name__}")
        if not 0 <= count < 1 << 32:
            raise errors.BadArgument(f"a number of {count} subscribers: use 0 to 2**32 - 1")
        # Its descriptor stays readable until subscribers_changed() took the number.
        status = in_pieces(timeout, lambda ms: _c.lib.gimi_wait_for_subscribers(self._handle, count, ms))
        if status == _c.GIMI_TIMEOUT:
            raise errors.Timeout(f"there were not {count} subscribers within {timeout} s")
        self.check(status)

    def subscribers_changed(self, timeout: Optional[float] = None) -> int:
        """Waits until their number is another one than this told last, and tells it; the first call does not
        wait. Timeout, Closed."""
        count = ctypes.c_size_t()
        self.wait(timeout, lambda ms: _c.lib.gimi_subscribers_changed(self._handle, ms, count))
        return count.value


@dataclass(frozen=True)
class State:
    """The connection of a node at one moment. `ended`: it will not connect again; `trouble` says why it
    broke last. Times are in seconds, of the hub's clock against this one."""

    id: Peer
    name: str
    hub_id: int
    hub_name: str
    connected: bool
    ended: bool
    reconnects: int
    trouble: str
    hub_round_trip: float
    hub_clock_offset: float


class Node(Waitable):
    """A program on the network. Made by connect(); leaves with close(), or at the end of `with`."""

    def __init__(self, handle: int) -> None:
        super().__init__(handle)
        self._senders: Dict[Tuple[Union[str, Peer], str, bool], int] = {}
        self._asked: Set[str] = set()  # services, of which the library knows the place
        Exit.add(handle, self)

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _opened(self, function: Any, *arguments: Any) -> int:
        """The handle of a call that may wait."""
        handle = ctypes.c_uint64()
        interruptible(lambda: self.check(function(self._handle, *arguments, handle)), lambda: _close(handle))
        return handle.value

    def _opened_at_once(self, function: Any, *arguments: Any) -> int:
        handle = ctypes.c_uint64()
        self.check(function(self._handle, *arguments, handle))
        return handle.value

    def state(self) -> State:
        """The connection now, or as it was last."""
        raw = sized(_c.gimi_node_state)
        self.check(_c.lib.gimi_state(self._handle, raw))
        return State(Peer(raw.id), raw.name.decode(), raw.hub_id, raw.hub_name.decode(), bool(raw.connected), bool(raw.ended),
                     raw.reconnects, raw.trouble.decode(errors="replace"), raw.hub_round_trip_ns / 1e9,
                     raw.hub_clock_offset_ns / 1e9)

    def watch_connection(self) -> ConnectionWatch:
        """Tells what becomes of the connection: lost, back, ended, and why."""
        return ConnectionWatch(self, self._opened_at_once(_c.lib.gimi_watch_connection))

    @property
    def id(self) -> Peer:
        """By which others know this node; Peer(0) if it is closed."""
        self.check_process()
        return Peer(_c.lib.gimi_id(self._handle))

    @property
    def name(self) -> str:
        """As the hub knows it; "" of a node without a name."""
        return self.state().name

    def advertise(self, name: str, *, delivery: str = "stream", window: int = 0, retain: bool = False,
                  key: Tuple[int, int] = (0, 0), metadata: str = "", age_max: float = 0.0,
                  lane: str = "normal", timeout: float = 5.0) -> Publisher:
        """Provides the service `own name/name`. `delivery`: stream, latest, or sync, at most `window`
        messages that a subscriber has not taken. `age_max`: dropped on the way when older. `lane`:
        real_time, normal, bulk or background; a lower one goes first. BadName, Taken, Denied (a node without a
        name)."""
        options = sized(_c.gimi_publish_options, key=to_key(key), window=window,
                         delivery=messages.chosen("delivery", messages.DELIVERIES, delivery),
                         lane=messages.chosen("lane", messages.LANES, lane), retain=retain, metadata=to_text(metadata), timeout_ms=to_ms(timeout),
                         age_ms_max=to_ms(age_max) if age_max else 0)
        return Publisher(self, self._opened(_c.lib.gimi_advertise, to_text(name), options))

    def subscribe(self, full_name: str, *, rate_hz: Optional[float] = None, newest_only: bool = False,
                  queue: Optional[int] = None, silence: Optional[float] = None, window: int = 0, depth: int = 0,
                  timeout: float = 5.0) -> Source:
        """Subscribes to a service, which need not exist yet; each call has a queue of its own. `rate_hz`: the
        newest at each due time. `newest_only`: only the newest waits. `queue`: messages that may wait; the
        oldest is overwritten. Default: 64, and more while they take at most 16 MiB. `silence`: receive() raises
        Silence once in that time while nothing comes. `window`, `depth`: for experts. BadName, NotFound (it takes
        commands)."""
        for option, value in (("rate_hz", rate_hz), ("queue", queue), ("silence", silence)):
            if value is not None and value == 0:  # the C functions take 0 for a wish that nobody has
                raise errors.BadArgument(f"{option} is 0: use more than 0, or leave it out")
        options = sized(_c.gimi_subscribe_options, rate_hz=rate_hz or 0.0, queue=queue or 0, timeout_ms=to_ms(timeout),
                         newest_only=newest_only, silence_ms=to_ms(silence) if silence else 0, window=window,
                         depth=depth)
        return Source(self, self._opened(_c.lib.gimi_subscribe, to_text(full_name), options))

    def accept(self, name: str, *, queue: int = 0, key: Tuple[int, int] = (0, 0), metadata: str = "",
               timeout: float = 5.0) -> Source:
        """Takes the commands that others send to `own name/name`, until close() or the end of the node. Each
        accepted service has a queue of its own."""
        options = sized(_c.gimi_accept_options, key=to_key(key), messages=queue, metadata=to_text(metadata),
                         timeout_ms=to_ms(timeout))
        return Source(self, self._opened(_c.lib.gimi_accept, to_text(name), options), kept=True)

    def send(self, to: Union[str, Peer], value: Any, timeout: Optional[float] = 1.0, *, lane: str = "normal",
             confirm: bool = False, wait_if_away: bool = False) -> None:
        """Sends to the service of that full name, or to a Peer of find(). `lane`: as of advertise(), and
        the same each time. It does not tell if the message is lost on its way. With `confirm` it waits until the
        receiver has the message in its queue. `wait_if_away`: it waits for a service that is away. NotFound (also of
        one that is away), Timeout (not sent, or not confirmed: it may still arrive), NotConnected, NotDelivered (why it
        is lost, or may be), TooLarge, BadArgument."""
        sender = self._sender(to, lane, wait_if_away, timeout)
        data, size, keeps = messages.payload(value)
        if not confirm and size <= _PIECES_BYTES_MAX:
            status = in_pieces(timeout, lambda ms: _c.lib.gimi_try_send(sender, data, size, ms, 0),
                               lambda ms: _c.lib.gimi_send(sender, data, size, ms, 0))
            return self.check(status)
        ms = left_ms(end_of(timeout), TIMEOUT_MS_MAX)

        def call(_: Any = keeps) -> None:
            """In one piece: a second call would send the message a second time. A large one that had begun when
            its time was over goes on in the library, and nobody would hear that its receiver refused it."""
            self.check(_c.lib.gimi_send_confirmed(sender, data, size, ms) if confirm else
                       _c.lib.gimi_send(sender, data, size, ms, 0))

        interruptible(call)

    def _sender(self, to: Union[str, Peer], lane: str, wait_if_away: bool, timeout: Optional[float]) -> int:
        sender = self._senders.get((to, lane, wait_if_away))
        if sender is None:
            options = sized(_c.gimi_send_options, lane=messages.chosen("lane", messages.LANES, lane), wait_if_away=wait_if_away)
            made = (self._opened_at_once(_c.lib.gimi_sender, _peer(to), options) if isinstance(to, Peer) else
                    self._opened(_c.lib.gimi_sender_to_service, to_text(to), options,
                                 max(1, left_ms(end_of(timeout), TIMEOUT_MS_MAX))))
            sender = self._senders.setdefault((to, lane, wait_if_away), made)
            if sender != made:  # another thread was faster
                _c.lib.gimi_close(made)
        return sender

    def answer(self, name: str, *, metadata: str = "", timeout: float = 5.0) -> Answers:
        """Answers the questions that others ask `own name/name`, until close() or the end of the node."""
        options = sized(_c.gimi_answer_options, metadata=to_text(metadata), timeout_ms=to_ms(timeout))
        return Answers(self, self._opened(_c.lib.gimi_answer, to_text(name), options))

    def request(self, service: str, value: Any, timeout: float = 5.0, *, repeat: bool = False, lane: str = "normal") -> Reply:
        """Asks whoever answers the service, and waits for the end of the request, of which there is exactly
        one. Failed (the other's own error), NotFound, Busy, Gone, Timeout, NotDelivered ...: `ran` of the
        exception says whether the work may have been done. `repeat`: it may be done twice. `lane`: of it and its
        answer."""
        with self.request_later(service, value, timeout, repeat=repeat, lane=lane) as pending:
            return pending.receive()

    def request_later(self, service: str, value: Any, timeout: float = 5.0, *, repeat: bool = False,
                      lane: str = "normal") -> Pending:
        """Asks and does not wait. `timeout` ends the request; close() cancels it."""
        data, size, keeps = messages.payload(value)
        block = _c.gimi_bytes(ctypes.cast(data, ctypes.c_void_p), size)
        options = sized(_c.gimi_request_options, timeout_ms=to_ms(timeout), repeat=repeat,
                        lane=messages.chosen("lane", messages.LANES, lane))
        # A thread for each request would cost more than a short request.
        at_once = service in self._asked and size <= _SMALL_BYTES
        opened = self._opened_at_once if at_once else self._opened
        try:
            pending = Pending(self, opened(_c.lib.gimi_ask_later, to_text(service), block, options))
            self._asked.add(service)
            return pending
        except errors.GimnetError as error:
            self._asked.discard(service)
            error.ran = "no"
            raise
        finally:
            del keeps

    def find(self, name: str, timeout: float = 5.0) -> Peer:
        """A node by its name, or by its id as text (`7.17`). NotFound, BadName, Timeout."""
        peer = ctypes.c_uint32()
        words, ms = to_text(name), to_ms(timeout)
        interruptible(lambda: self.check(_c.lib.gimi_find(self._handle, words, ms, peer)))
        return Peer(peer.value)

    def nodes(self, pattern: str = "", timeout: float = 5.0) -> List[NodeRecord]:
        """Those whose name matches (`*` one part, `**` any number); "": all."""
        return [NodeRecord.of(raw) for raw in self._list(_c.lib.gimi_nodes, _c.gimi_node_record, pattern, timeout)]

    def services(self, pattern: str = "", timeout: float = 5.0) -> List[ServiceRecord]:
        """Those whose full name matches."""
        return [ServiceRecord.of(raw) for raw in self._list(_c.lib.gimi_services, _c.gimi_service_record, pattern, timeout)]

    def _list(self, function: Any, record: Type[Raw], pattern: str, timeout: float) -> Iterator[Raw]:
        """Each is valid until the next one."""
        records, words, ms = _c.gimi_list(), to_text(pattern), to_ms(timeout)
        interruptible(lambda: self.check(function(self._handle, words, ms, records)),
                      lambda: _c.lib.gimi_list_release(records))
        try:
            for index in range(records.count):
                raw = record()
                errors.check(_c.lib.gimi_list_get(records, index, ctypes.addressof(raw), ctypes.sizeof(raw)))
                yield raw
        finally:
            _c.lib.gimi_list_release(records)

    def watch(self, pattern: str = "**", *, nodes: bool = True, services: bool = True, timeout: float = 5.0) -> Watch:
        """Tells of the nodes and services that match: first what is there, then what changes."""
        subjects = nodes * _c.GIMI_WATCH_NODES | services * _c.GIMI_WATCH_SERVICES
        if not subjects:
            raise errors.BadArgument("a watch needs a subject: nodes, services, or both")
        return Watch(self, self._opened(_c.lib.gimi_watch, to_text(pattern), subjects, to_ms(timeout)))

    def receive(self, timeout: Optional[float] = None) -> Message:
        """The message that waited longest, of those that no accepted service or subscription takes too."""
        raw = _c.gimi_message()
        self.wait(timeout, lambda ms: _c.lib.gimi_receive(self._handle, ms, raw))
        return messages.taken(raw)


def connect(name: str = "", *, hub: str = "", description: str = "", timeout: float = 5.0,
            wait_for_hub: Union[bool, float] = False, number_if_taken: bool = False, message_bytes_max: int = 0) -> Node:
    """Joins the network under that name, or without one. `hub`: `tcp://host:port` or `unix:/path`; "":
    GIMNET_HUB, else the hub of this machine. `wait_for_hub`: dials again until there is a hub, for so many
    seconds; True: for `timeout`. `number_if_taken`: else as NAME-2 ... NAME-99. `message_bytes_max`: of the
    largest message that it takes, 0: 64 MiB, at most 1 GiB. NoHub, NameTaken, BadName, Timeout, ..."""
    within = wait_for_hub if wait_for_hub and not isinstance(wait_for_hub, bool) else timeout
    options = sized(_c.gimi_node_options, name=to_text(name), hub=to_text(hub), description=to_text(description),
                     timeout_ms=to_ms(within), wait_for_hub=bool(wait_for_hub), number_if_taken=number_if_taken,
                     message_bytes_max=message_bytes_max)
    handle = ctypes.c_uint64()
    interruptible(lambda: errors.check(_c.lib.gimi_join(options, handle)), lambda: _close(handle))
    return Node(handle.value)
