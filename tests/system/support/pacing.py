"""Readers of a given speed."""

import time

from support.wire import HEADER, Closed


class ByteReader:
    """Takes from a client exactly the bytes that it is told to, and never more than so many a second: for a fast reader
    the hub lets the kernel hold more. Its clock is what it took, not the machine's."""

    def __init__(self, client, bytes_per_s):
        self._client, self._rate, self.taken = client, bytes_per_s, len(client._bytes)

    def take(self, count):
        """Takes so many bytes. The frames that are whole by then, each with the number of bytes taken at its end."""
        buffer, frames = self._client._bytes, []
        time.sleep(count / self._rate)
        while count:
            more = self._client.socket.recv(count)
            if not more:
                raise Closed()
            buffer += more
            count -= len(more)
            self.taken += len(more)
        while len(buffer) >= HEADER and len(buffer) >= HEADER + int.from_bytes(buffer[:4], "little"):
            end = self.taken - len(buffer) + HEADER + int.from_bytes(buffer[:4], "little")
            frames.append((self._client.next(), end))
        return frames


class SlowReader:
    """Takes frames from a client at so many bytes a second, in pieces of at most 16 KiB, and no faster. Keeps alive."""

    def __init__(self, client, bytes_per_s):
        self._client, self._rate = client, bytes_per_s
        self._begin, self._taken = time.monotonic(), 0
        self._pinged = self._begin
        take, recv = client._take, client.socket.recv

        def paced(size):
            while len(client._bytes) < size:
                due = self._begin + self._taken / self._rate
                time.sleep(max(0.0, due - time.monotonic()))
                if time.monotonic() - self._pinged > 0.5:
                    self._pinged = time.monotonic()
                    client.ping()
                # Time in which nothing was there to read is not made up for.
                self._begin = max(self._begin, time.monotonic() - (self._taken + 65536) / self._rate)
                more = recv(16384)
                if not more:
                    break
                self._taken += len(more)
                client._bytes += more
            return take(size)
        client._take = paced

    def next(self):
        return self._client.next()
