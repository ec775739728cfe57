"""A TCP proxy in front of a hub whose connections can be dropped."""

import select
import socket
import threading
import time


class Proxy:
    """Listens on a free port (`url`) and carries bytes to a port of loopback and back. Ends with the test."""

    def __init__(self, test, port):
        self._to = ("127.0.0.1", port)
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=256)
        self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self.dropped = 0
        self._lock = threading.Lock()
        self._other = {}  # each socket's other end
        self._wake_in, self._wake_out = socket.socketpair()
        self._ended = False
        self._refuses_until = 0.0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        test.addCleanup(self._end)

    def drop_all(self):
        """Closes every connection at both ends, as a broken line would; returns how many those were."""
        with self._lock:
            ends = list(self._other)
            for end in ends:
                self._close(end)
            self.dropped += len(ends) // 2
        self._wake_out.send(b"x")
        return len(ends) // 2

    def break_for(self, seconds):
        """The same, and nobody gets through for so long."""
        self._refuses_until = time.monotonic() + seconds
        return self.drop_all()

    def _close(self, end):
        self._other.pop(end, None)
        end.close()

    def _run(self):
        while not self._ended:
            with self._lock:
                watched = [self._listener, self._wake_in, *self._other]
            try:
                ready = select.select(watched, [], [])[0]
            except (OSError, ValueError):  # one of them was dropped meanwhile
                continue
            for end in ready:
                self._serve(end)

    def _serve(self, end):
        if end is self._wake_in:
            end.recv(4096)
        elif end is self._listener:
            near = end.accept()[0]
            if time.monotonic() < self._refuses_until:
                return near.close()
            try:
                far = socket.create_connection(self._to)
            except OSError:  # nobody listens there at the moment
                near.close()
                return
            with self._lock:
                self._other[near], self._other[far] = far, near
        else:
            self._carry(end)

    def _carry(self, end):
        with self._lock:
            other = self._other.get(end)
            if other is None:
                return
            try:
                data = end.recv(1 << 16)
                if data:
                    other.sendall(data)
                    return
            except OSError:
                pass
            self._close(end)
            self._close(other)

    def _end(self):
        self._ended = True
        self._wake_out.send(b"x")
        self._thread.join(20)
        self.drop_all()
        for end in (self._listener, self._wake_in, self._wake_out):
            end.close()
