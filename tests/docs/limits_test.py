#!/usr/bin/env python3
"""docs/protocol.md, "Limits, timers and states", says what src/hub/limits.hpp and the headers of src/proto say."""

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
SECTION = re.search(r"^## Limits, timers and states\n(.*?)(?=^## )", PAGE, re.S | re.M)[1]
# What no peer can tell from outside: turns, sockets, the log.
UNSEEN = {"told_at_once", "turn_bytes", "turn_deliveries", "socket_send_bytes", "unsent_ms", "unsent_bytes", "log_lines_per_s", "peer_log_lines_per_s"}


def number(text):
    """Of a C++ expression: digits with separators and suffixes, * and <<."""
    text = re.sub(r"(?<=\d)'(?=\d)", "", text)
    text = re.sub(r"std::(?:uint32_t|size_t)\{(\d+)\}", r"\1", text)
    text = re.sub(r"(?<=\d)u?l{0,2}\b", "", text)
    assert re.fullmatch(r"[\d\s*+<()]+", text), text
    return eval(text)  # pylint: disable=eval-used  # nothing but numbers


def defaults():
    text = (ROOT / "src" / "hub" / "limits.hpp").read_text(encoding="utf-8")
    struct = text[text.index("struct Limits {"):text.index("};")]
    return {name: number(value) for name, value in re.findall(r"^  std::uint64_t (\w+) = (.*);$", struct, re.M)}


def constant(name):
    for header in (*sorted((ROOT / "src" / "proto").rglob("*.hpp")), ROOT / "src" / "hub" / "shard" / "connection.hpp"):
        found = re.search(rf"^inline constexpr [\w:]+ {name} = (.*);", header.read_text(encoding="utf-8"), re.M)
        if found:
            return number(found[1])
    raise AssertionError(f"no {name} in src/proto nor of a connection")


def rows(heading):
    """The cells of each row of the tables under that heading."""
    part = re.search(rf"^### {heading}\n(.*?)(?=^### |\Z)", SECTION, re.S | re.M)[1]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines()
            if line.startswith("|") and not line.startswith("| ---")]


class Tables(unittest.TestCase):
    def setUp(self):
        self.defaults = defaults()
        self.assertGreater(len(self.defaults), 40)
        self.timers = rows("Timers")[1:]
        self.limits = [row for row in rows("Limits") if re.fullmatch(r"[a-z0-9_]+", row[0]) and len(row) == 4 and row[0] != "key"]

    def test_each_timer_has_the_default_of_its_key(self):
        self.assertGreater(len(self.timers), 10)
        for name, default, key, what in self.timers:
            keys = re.findall(r"`(\w+)`", key)
            self.assertTrue(what, name)
            if len(keys) == 1:
                self.assertEqual(default, f"{self.defaults[keys[0]]} ms", name)
        rest = self.defaults["grace_ms"] + max(self.defaults["block_ms"], self.defaults["slow_consumer_ms"])
        self.assertIn(["rest of an id", f"{rest} ms"], [row[:2] for row in self.timers])

    def test_each_limit_has_its_default(self):
        for key, default, unit, what in self.limits:
            self.assertIn(key, self.defaults)
            self.assertEqual(default, str(self.defaults[key]), key)
            self.assertTrue(unit and what, key)

    def test_every_key_is_in_one_of_the_tables(self):
        limits = [row[0] for row in self.limits]
        timers = {key for row in self.timers for key in re.findall(r"`(\w+)`", row[2])}
        self.assertEqual(len(limits), len(set(limits)), "a limit stands twice")
        self.assertEqual(set(limits) & timers, set())
        self.assertEqual(set(limits) | timers | UNSEEN, set(self.defaults))
        self.assertEqual([key for key in self.defaults if key in limits], limits, "in the order of limits.hpp")

    def test_the_protocols_own_are_those_of_the_source(self):
        said = {row[0]: row[1] for row in rows("Limits") if len(row) == 3}
        for words, name in (("recipients of a LIST", "kListRecipientsMax"),
                            ("bytes of a name, and of a pattern", "kNameBytesMax"),
                            ("parts of a name, and of a pattern", "kNamePartsMax"),
                            ("bytes of a session token", "kTokenBytesMax"),
                            ("bytes of a description", "kDescriptionBytesMax"), ("bytes of metadata", "kMetadataBytesMax"),
                            ("bytes of a sentence", "kSentenceBytesMax"),
                            ("bytes of KICK's reason, LOG_LEVEL's level and the words of other answers", "kRemarkBytesMax"),
                            ("bytes of a message in fragments", "kMessageBytesMax")):
            self.assertEqual(said.pop(words), str(constant(name)), words)
        self.assertEqual(list(said), ["what"], "of which the source is not named here")

    def test_the_states_name_only_codes_and_states_that_there_are(self):
        for heading, names in (("States of a connection", ["stranger", "admitted", "held", "draining", "ending", "closed"]),
                               ("States of a session", ["connected", "declaring", "away", "ended"])):
            table = rows(heading)
            self.assertEqual([row[0] for row in table[1:]], names)
            for row in table[1:]:
                self.assertLessEqual(set(re.findall(r"\*(\w+)\*", " ".join(row))), set(names), row[0])
                for code in re.findall(r"GOODBYE `(\w+)`", " ".join(row)):
                    self.assertRegex(PAGE, rf"(?m)^\| \d+ \| {code} \|")


if __name__ == "__main__":
    unittest.main()
