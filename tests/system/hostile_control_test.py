#!/usr/bin/env python3
"""Requests, administrators and names that mean no good: what they get for an answer, and what they leave in the log."""

import base64
import json
import pathlib
import re
import unittest

from support.processes import Hub, run_gimnet
from support.waiting import wait_until
from support.wire import CTRL, NS, OPENING, Client, Closed, control, frame, hello, number, text, value

RESOLVE, REGISTER, SERVICES = 3, 1, 9
KICK, REASSIGN, LOG_LEVEL = 4, 5, 8
BAD_REQUEST, NOT_FOUND, DENIED = 2, 3, 5
ADMIN = 2


class Administrators(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)
        self.admin = Client(self, self.hub, local=True).join(role=ADMIN)
        self.victim = Client(self, self.hub).join("victim")

    def tearDown(self):
        self.victim.ping()
        self.victim.next()
        self.assertEqual(self.victim.ask(CTRL, 1)[1], 0, "the hub and the victim are well")

    def status_of(self, operation, body):
        return self.admin.ask(CTRL, operation, body)[1]

    def test_arguments_are_never_paths_or_commands(self):
        for words in ("../../etc/passwd", "/etc/passwd", "info; touch /tmp/x", "$(id)", "`id`", "info\ninfo", "info\0",
                      "INFO", " info", "%s%n", "a" * 30_000):
            with self.subTest(words=words[:20]):
                self.assertEqual(self.status_of(LOG_LEVEL, text(3, words)), BAD_REQUEST)
                self.assertEqual(self.status_of(KICK, text(3, words)), BAD_REQUEST, "an id is a number")
                self.assertEqual(self.status_of(REASSIGN, text(3, words) + text(4, words)), BAD_REQUEST)

    def test_a_megabyte_is_longer_than_any_frame(self):
        self.admin.send(self.admin.frame(0, b"", kind=CTRL, length=1 << 20))
        self.assertEqual(self.admin.goodbye(), "malformed")

    def test_nesting_without_end(self):
        deep = b"\0"
        for _ in range(10_000):
            if len(deep) > 60_000:
                break
            deep = value(3, 14, deep)
        for operation in (KICK, REASSIGN, LOG_LEVEL):
            self.assertEqual(self.status_of(operation, deep), BAD_REQUEST)

    def test_ids_at_the_ends(self):
        for node in (0, 7 << 20, 0x7FFFFF, 0xFFFFFFFF, 8 << 20 | 1, self.victim.id + 1000):
            with self.subTest(node=node):
                self.assertEqual(self.status_of(KICK, number(3, 4, node)), NOT_FOUND)
                self.assertIn(self.status_of(REASSIGN, number(3, 4, self.victim.id) + number(4, 4, node)),
                              (BAD_REQUEST, 0) if node == self.victim.id + 1000 else (BAD_REQUEST,))
        self.victim = Client(self, self.hub).join("victim")  # it was given the last one

    def test_a_reason_stays_one_line_of_the_log(self):
        other = Client(self, self.hub).join("other")
        reason = "no\n2026-01-01T00:00:00.000Z error all is lost\x1b[2J\x07%s%n"
        self.assertEqual(self.status_of(KICK, number(3, 4, other.id) + text(4, reason)), 0)
        self.assertEqual(other.goodbye(), "kicked")
        wait_until(lambda: "kicked by" in self.hub.process.err, "the line about it")
        self.assertNotIn("\x1b", self.hub.process.err)
        self.assertIn("no\\x0a2026-01-01T00:00:00.000Z error all is lost\\x1b[2J\\x07%s%n", self.hub.process.err)

    def test_nodes_may_look_and_change_nothing(self):
        node = Client(self, self.hub, local=True).join("plain")
        for operation, body in ((4, number(3, 4, self.victim.id)), (5, number(3, 4, self.victim.id) + number(4, 4, 9)),
                                (6, b""), (7, b""), (8, text(3, "off"))):
            with self.subTest(operation=operation):
                self.assertEqual(node.ask(CTRL, operation, body)[1], DENIED)
        for operation in (1, 2, 3, 9):
            self.assertEqual(node.ask(CTRL, operation)[1], 0)


class Rates(unittest.TestCase):
    def test_more_oddities_than_allowed_close_the_connection(self):
        hub = Hub(self, "--limit", "oddities_burst=5", "--limit", "oddities_per_s=1")
        client = Client(self, hub).join("odd")
        count = 0
        with self.assertRaises(Closed):
            while True:
                self.assertEqual(client.ask(NS, RESOLVE, b"\xff")[1], BAD_REQUEST)
                count += 1
        self.assertGreaterEqual(count, 5)
        self.assertEqual(hub.counter("oddities"), 1)

    def test_more_declarations_than_allowed_are_refused_with_words(self):
        hub = Hub(self, "--limit", "declarations_burst=3", "--limit", "declarations_per_s=1", "--limit",
                  "services_per_node=0", "--limit", "subscriptions_per_node=0")
        client = Client(self, hub).join("changing")
        answers = [client.ask(NS, REGISTER, text(3, f"name-{i}")) for i in range(1000)]
        refused = [answer for answer in answers if answer[1] == 7]
        self.assertGreater(len(refused), 0)
        self.assertIn("--limit declarations_per_s", refused[0][2])
        self.assertGreaterEqual(len(answers) - len(refused), 3)
        self.assertEqual(hub.status()["counters"]["names.refused.rate"], len(refused))


class Log(unittest.TestCase):
    NAME = "\x1b[31m\u202e\n2026-01-01T00:00:00.000Z info 'admin' joined%s%n"

    def refuse(self, hub):
        client = Client(self, hub).send(OPENING + hello(self.NAME))
        self.assertEqual(client.first_answer().goodbye, "bad_name")
        client.socket.close()

    def test_errors_without_end_are_one_line_each_few_and_counted(self):
        hub = Hub(self, "--limit", "peer_log_lines_per_s=1")
        sent = 0

        def told():
            """Refused peers that the log tells of, in a line of their own or in the count of a later one."""
            lines = [line for line in hub.process.err.splitlines() if " refused tcp" in line]
            left_out = sum(int(number) for number in re.findall(r"\((\d+) lines like this were left out\)", "\n".join(lines)))
            return len(lines), left_out

        for _ in range(300):
            self.refuse(hub)
            sent += 1
        while True:  # until a line tells of those that were left out
            self.refuse(hub)
            sent += 1
            lines, left_out = told()
            if left_out:
                break
        # What the log has not told yet is at most what came after its last line.
        self.assertLess(lines, sent)
        self.assertLessEqual(lines + left_out, sent)
        self.assertGreater(left_out, 1)
        whole = hub.process.err.rpartition("\n")[0]  # a line may be on its way
        for line in whole.splitlines():
            self.assertRegex(line, r"^\d{4}-\d\d-\d\dT[\d:.]+Z (info|warning|error) ")
            self.assertIn(" refused tcp ", line)
        self.assertTrue(hub.process.err.isascii())
        self.assertNotIn("\x1b", hub.process.err)
        self.assertIn("'\\x1b[31m\\xe2\\x80\\xae\\x0a2026-01-01", hub.process.err)

    def test_secrets_are_shown_nowhere(self):
        hub = Hub(self, "--log-level", "debug")
        node = Client(self, hub).join("keeper")
        token = node.welcome[2]
        mac = token[24:]
        wrong = token[:-1] + bytes([token[-1] ^ 1])
        # In its place, altered, and in places where it does not belong.
        Client(self, hub).join("other", token=wrong)
        Client(self, hub).send(OPENING + hello(extra=value(2, 12, token))).until_closed()
        Client(self, hub).send(OPENING + hello(extra=value(8, 12, token))).until_closed()
        for operation, body in ((RESOLVE, value(3, 12, token)), (REGISTER, value(3, 12, token)),
                                (SERVICES, value(3, 12, token)), (RESOLVE, value(3, 0, token))):
            answer = node.ask(NS, operation, body)
            self.assertEqual(answer[1], BAD_REQUEST)
            self.assert_hidden(mac, answer[2].encode(), "a sentence")
        node.ask(CTRL, 0x7FF, token)
        node.send(node.frame(0, token[:3], kind=CTRL)).until_closed()
        back = Client(self, hub).join("keeper", token=token)
        self.assertEqual(back.id, node.id)
        wait_until(lambda: "came back" in hub.process.err, "the line about its return")
        seen = {"the log": hub.process.err.encode()}
        for words in (["status", "--json"], ["status"], ["nodes", "--all", "--json"], ["ctl", "connections", "--json"]):
            seen["gimnet " + " ".join(words)] = bytes(run_gimnet(f"unix:{hub.socket_path}", *words).out)
        json.loads(seen["gimnet status --json"])
        secret = next(pathlib.Path(hub.state).rglob("state")).read_bytes()
        secrets = {mac, back.welcome[2][24:]} | {secret[at:at + 8] for at in range(8, 72) if any(secret[at:at + 8])}
        for where, content in seen.items():
            for each in secrets:
                self.assert_hidden(each, content, where)

    def assert_hidden(self, secret, content, where):
        """No eight bytes of it, however they are written."""
        for at in range(0, len(secret) - 7):
            piece = secret[at:at + 8]
            for written in (piece, piece.hex().encode(), piece.hex().upper().encode(), base64.b64encode(piece)[:10],
                            "".join(f"\\x{byte:02x}" for byte in piece).encode()):
                self.assertNotIn(written, content, where)


class Fields(unittest.TestCase):
    def test_values_of_the_wrong_kind(self):
        hub = Hub(self)
        client = Client(self, hub).join("confused")
        not_a_number = value(6, 11, b"\0\0\0\0\0\0\xf8\x7f")
        for operation, body in ((RESOLVE, number(3, 4, 1)), (4, text(3, "7.1")), (4, number(3, 5, 1 << 40)),
                                (4, value(3, 4, b"\1\2\3")), (5, number(6, 2, 1)), (5, text(5, "many")),
                                (7, number(3, 4, 1)), (8, value(3, 14, text(3, "x"))),
                                (10, text(3, "a/b") + not_a_number), (10, text(3, "a/b") + text(4, "1"))):
            with self.subTest(operation=operation, body=body):
                self.assertGreater(client.ask(NS, operation, body)[1], 0)
        self.assertEqual(client.ask(NS, RESOLVE, text(3, "confused"))[3], client.id)

    def test_a_frame_before_hello_runs_no_handler(self):
        hub = Hub(self)
        for kind, operations in ((NS, range(0, 40)), (CTRL, range(0, 12))):
            for operation in operations:
                client = Client(self, hub)
                client.send(OPENING + frame(0, 0, control(operation, text(3, "x"), 1), kind=kind))
                self.assertEqual(client.first_answer().goodbye, "malformed")
        self.assertEqual([name for name in hub.status()["counters"] if name.startswith("names.")], [])


if __name__ == "__main__":
    unittest.main()
