"""A TCP proxy of a given rate with small buffers: what stands between a node and its hub on a slow radio. It can cut
the connections that go through it."""

import socket
import threading
import time

BUFFER_BYTES = 4096  # of each socket in the kernel (Linux doubles it), so that what waits does so at the hub
PIECE_BYTES = 1024


class Pace:
    """Lets so many bytes a second through, of all who share it; None: any number."""

    def __init__(self, bytes_per_s):
        self.bytes_per_s = bytes_per_s
        self._lock = threading.Lock()
        self._free_at = 0.0

    def wait(self, size):
        if self.bytes_per_s is None:
            return
        with self._lock:
            now = time.monotonic()
            self._free_at = max(self._free_at, now) + size / self.bytes_per_s
            wake_at = self._free_at
        time.sleep(max(0.0, wake_at - now))


class Allowance:
    """A pace without a clock: lets through what it is granted, of one connection; anything until bound() is called. What a
    grant finds unused is void, as on a line that had nothing to carry. `news` is notified of all that changes."""

    def __init__(self):
        self.news = threading.Condition()
        self._left, self._wanted, self._bound = 0.0, None, False

    def bound(self):
        with self.news:
            self._bound = True

    def lift(self):
        with self.news:
            self._bound = False
            self.news.notify_all()

    def grant(self, size):
        with self.news:
            self._left = size + (self._left if self._wanted is not None else 0.0)
            self.news.notify_all()

    @property
    def used_up(self):
        """More is there than may go. Whoever asks holds `news`."""
        return self._bound and self._wanted is not None and self._wanted > self._left

    def wait(self, size):
        with self.news:
            self._wanted = size
            self.news.notify_all()
            self.news.wait_for(lambda: not self._bound or self._left >= size)
            self._left -= size if self._bound else 0.0
            self._wanted = None


class RateProxy:
    """Forwards connections to a port of this machine. Down is towards who dialed. Close it when done."""

    def __init__(self, port, down_bits_per_s=None, up_bits_per_s=None, down=None):
        """`down`: an Allowance in place of a rate."""
        self.target = port
        self.down = down or Pace(down_bits_per_s and down_bits_per_s / 8)
        self.up = Pace(up_bits_per_s and up_bits_per_s / 8)
        self.accepted = self.down_bytes = self.up_bytes = 0
        self._lock = threading.Lock()
        self._open = set()
        self._closing = False
        self._listener = self._small(socket.socket())
        self._listener.bind(("127.0.0.1", 0))
        self._listener.listen(64)
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def url(self):
        return f"tcp://127.0.0.1:{self.port}"

    def cut(self):
        """Ends all connections that are open; bytes that are held are lost. Returns how many there were."""
        with self._lock:
            cut, self._open = self._open, set()
        for pair in cut:
            for end in pair:
                self._shut(end)
        return len(cut)

    def close(self):
        self._closing = True
        if isinstance(self.down, Allowance):
            self.down.lift()  # nobody waits for it any more
        self._shut(self._listener)
        self.cut()

    @staticmethod
    def _small(end):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
        return end

    @staticmethod
    def _shut(end):
        for step in (lambda: end.shutdown(socket.SHUT_RDWR), end.close):
            try:
                step()
            except OSError:
                pass

    def _accept(self):
        while not self._closing:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            far = self._small(socket.socket())
            try:
                far.connect(("127.0.0.1", self.target))
                near.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                far.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            except OSError:
                self._shut(near)
                self._shut(far)
                continue
            pair = (near, far)
            with self._lock:
                self.accepted += 1
                self._open.add(pair)
            for source, sink, pace in ((far, near, self.down), (near, far, self.up)):
                threading.Thread(target=self._forward, args=(pair, source, sink, pace), daemon=True).start()

    def _forward(self, pair, source, sink, pace):
        try:
            while piece := source.recv(PIECE_BYTES):
                pace.wait(len(piece))
                with self._lock:  # before it is handed on: who has received bytes finds them counted
                    if pace is self.down:
                        self.down_bytes += len(piece)
                    else:
                        self.up_bytes += len(piece)
                sink.sendall(piece)
        except OSError:
            pass
        with self._lock:
            self._open.discard(pair)
        for end in pair:
            self._shut(end)
