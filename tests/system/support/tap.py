"""Counts frames of nodes where they pass, so that a hub's ledger is compared with somebody else's counting."""

import socket
import threading

HEADER, OPENING_SIZE, REPORT, FLOW, FIRST_OF_CONTROL = 16, 8, 5, 6, 16


class FrameCount:
    """The frames of nodes in one direction of a connection, from its opening on: without REPORT, FLOW and what is for the
    hub. A frame counts once its last byte came by."""

    def __init__(self, opening=OPENING_SIZE):
        self.frames = 0
        self.all = 0  # with those for the hub
        self._head = bytearray()
        self._left = opening  # bytes of it, or of a payload, that are to come
        self._is_data = False

    def feed(self, data):
        at = 0
        while at < len(data):
            if self._left:
                step = min(self._left, len(data) - at)
                self._left -= step
                at += step
            else:
                piece = data[at:at + HEADER - len(self._head)]
                self._head += piece
                at += len(piece)
                if len(self._head) < HEADER:
                    return
                self._left = int.from_bytes(self._head[:4], "little")
                self._is_data = self._head[12] < FIRST_OF_CONTROL and self._head[12] not in (REPORT, FLOW)
                self._head.clear()
            if not self._left and not self._head:
                self.all += 1
                self.frames += self._is_data
                self._is_data = False


class Tap:
    """Listens at `url`, as its hub does over TCP or a Unix socket, carries bytes to the hub and back, and counts the frames
    of nodes. Ends with the test."""

    def __init__(self, test, hub):
        self._path = hub.url[5:] if hub.url.startswith("unix:") else None
        self._to = self._path or ("127.0.0.1", hub.port)
        if self._path:
            self._listener = socket.socket(socket.AF_UNIX)
            self._listener.bind(self._path + ".tap")
            self._listener.listen(64)
            self.url = f"unix:{self._path}.tap"
        else:
            self._listener = socket.create_server(("127.0.0.1", 0))
            self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self.wait_for_node = hub.wait_for_node
        self._counts = []  # (to the hub, from the hub) of each connection
        self._ends = []
        test.addCleanup(self._close)
        threading.Thread(target=self._accept, daemon=True).start()

    def sent(self):
        """Frames that came by on their way to the hub."""
        return sum(up.frames for up, _ in list(self._counts))

    def got(self):
        """Frames that came by on their way from the hub."""
        return sum(down.frames for _, down in list(self._counts))

    def all_frames(self):
        """Both ways, with those for the hub."""
        return sum(up.all + down.all for up, down in list(self._counts))

    def _accept(self):
        try:
            while True:
                near = self._listener.accept()[0]
                far = socket.socket(socket.AF_UNIX if self._path else socket.AF_INET)
                for end in (near, far):
                    self._ends.append(end)
                    if not self._path:
                        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                far.connect(self._to)
                counts = (FrameCount(), FrameCount())
                self._counts.append(counts)
                for source, target, count in ((near, far, counts[0]), (far, near, counts[1])):
                    threading.Thread(target=self._carry, args=(source, target, count), daemon=True).start()
        except OSError:
            pass  # closed, or there is no hub any more

    @staticmethod
    def _carry(source, target, count):
        try:
            while data := source.recv(1 << 18):
                count.feed(data)
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)
        except OSError:
            for end in (source, target):
                try:
                    end.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass  # it has ended

    def _close(self):
        for end in [self._listener, *self._ends]:
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass  # it has ended
            end.close()
