#!/usr/bin/env python3
"""Strangers who say what docs/protocol.md forbids before they are admitted, or nothing, or half of it."""

import socket
import unittest

from support.bad_input import HostileInput
from support.wire import HELLO, LINK, NS, OPENING, Client, Closed, control, frame, hello, value


class Handshakes(HostileInput):
    def test_garbage_is_not_answered(self):
        for data in (b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GIMnot\x01\x00", bytes(1000)):
            with self.subTest(data=data[:8]):
                client = Client(self, self.hub).send(data)
                with self.assertRaises(Closed):
                    client.next()
                self.expect("refused.garbage")

    def test_who_ends_in_the_middle_of_its_handshake(self):
        whole = OPENING + hello("half")
        for size in (1, 7, 8, 9, 20, 24, 25, len(whole) - 1):
            with self.subTest(size=size):
                Client(self, self.hub).send(whole[:size]).socket.close()
                self.expect("refused.unfinished")

    def test_who_comes_and_goes_without_a_word_is_no_refusal(self):
        Client(self, self.hub).socket.close()

    def test_another_major_version(self):
        for major in (0, 2, 255):
            answer = self.refused_as(["bad_version"], b"GIMnet" + bytes([major, 0]) + hello())
            self.assertIn("1", answer.fields[2], "it names the version that is spoken here")

    def test_another_minor_version_is_welcome(self):
        client = Client(self, self.hub).send(b"GIMnet\x01\x63" + hello())
        self.assertIsNone(client.first_answer().goodbye)

    def test_a_hello_that_is_too_long(self):
        for length in (1024 - 8 - 16 + 1, 65536, 2**32 - 1):
            with self.subTest(length=length):
                self.refused_as(["malformed"], OPENING + frame(0, 0, control(HELLO), kind=LINK, length=length))

    def test_a_first_frame_that_is_no_hello(self):
        for data in (frame(1, 0, b"x"), frame(0, 0, control(HELLO), kind=NS), frame(0, 0, control(9), kind=LINK)):
            with self.subTest(data=data):
                self.refused_as(["malformed"], OPENING + data)

    def test_bad_names_and_roles(self):
        for name in ("/", "a//b", "a b", "x" * 256, "/".join("a" * 17), "7.1"):
            with self.subTest(name=name):
                self.refused_as(["bad_name", "malformed"], OPENING + hello(name))
        for role in (1, 2, 3, 255):
            with self.subTest(role=role):
                self.refused_as(["not_allowed", "malformed"], OPENING + hello(role=role))

    def test_unknown_keys_are_skipped_and_broken_ones_refused(self):
        client = Client(self, self.hub).send(OPENING + hello(extra=value(999, 0, b"later")))
        self.assertIsNone(client.first_answer().goodbye)
        bomb = b""
        for _ in range(20):
            bomb = value(9, 14, bomb or b"\0")
        for body in (b"\xff", bytes([12 << 3, 2, 0, 0, 50]) + b"short", value(2, 15, b"x"), bomb):
            with self.subTest(body=body[:8]):
                self.refused_as(["malformed"], OPENING + frame(0, 0, control(HELLO, body), kind=LINK))


class UnfinishedHandshakes(HostileInput):
    HANDSHAKE_MS = 3_000  # waited for; whoever means well is faster by far

    def test_half_an_opening_and_then_nothing(self):
        client = Client(self, self.hub).send(OPENING[:5])
        self.assertEqual([got.goodbye for got in self.after_opening(client)][-1:], ["hello_timeout"])
        self.expect("refused.hello_timeout")

    def after_opening(self, client):
        """Frames behind the opening; none where the hub closes without a word."""
        try:
            return [client.first_answer()]
        except Closed:
            return []

    def test_a_hello_that_never_ends(self):
        self.refused_as(["hello_timeout"], OPENING + frame(0, 0, control(HELLO), kind=LINK, length=500))

    def test_many_silent_connections_cost_nothing_that_stays(self):
        quiet = [socket.create_connection(("127.0.0.1", self.hub.port), timeout=20) for _ in range(500)]
        for connection in quiet:
            self.addCleanup(connection.close)
        for connection in quiet:
            data = b""
            while chunk := connection.recv(4096):
                data += chunk
            self.assertTrue(data.startswith(OPENING), data)
        self.expect("refused.hello_timeout", times=len(quiet))


if __name__ == "__main__":
    unittest.main()
