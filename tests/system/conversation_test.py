#!/usr/bin/env python3
"""A whole conversation of version 1 with a hub, as it was recorded once, is understood by the hub of today: each answer has
all that it had then, apart from tokens, epochs, times and the words of sentences.

    conversation_test.py --record NAME    records that one anew: only for what is not recorded yet"""

import pathlib
import struct
import sys
import unittest

from support import conversation
from support.conversation import Step
from support.conversation_scenes import SCENES
from support.processes import Hub
from support.waiting import wait_until
from support.wire import (BROADCAST, CREDIT, CTRL, FLAG_KEYED, FLAG_REPORT, FLOW, GOODBYE, GROUP, HEADER, LINK, LIST, NS,
                          OPENING, REPORT, SERVICE, UNICAST, WELCOME, Client, Closed, Frame, control, frame, hello, number, text,
                          value)

RECORDINGS = pathlib.Path(__file__).resolve().parent.parent / "vectors" / "conversation"
RECORDING = RECORDINGS / "version_1.txt"
TITLE = """A conversation of three nodes with a hub, version 1.0, as it was recorded. Later hubs and libraries go on understanding it:
tests/system/conversation_test.py plays the nodes' side to a hub, tests/client/nif/conversation_test.cpp the hub's side to
NIF. WHO > what a node sent, WHO < what the hub sent: the header in four words, and what is behind it."""
RENUMBERED = 7 << 20 | 100
# Nobody is silent too long on a slow machine: who has nothing to say here does not read either.
ARGUMENTS = ("--limit", "silent_ms=3000000", "--limit", "keep_alive_ms=600000")


def cut(test, hub, client, name):
    """The connection breaks; returns when the hub has seen it."""
    client.socket.close()
    witness = Client(test, hub).join()
    wait_until(lambda: 3 not in witness.ask(NS, 5, text(3, name) + number(6, 1, True)), f"{name} is away")


class Recorded(Client):
    """Notes every frame that it sends and gets."""

    def __init__(self, test, hub, who, steps, **how):
        super().__init__(test, hub, **how)
        self.who, self.steps = who, steps

    def send(self, data):
        rest = data
        while rest:
            size = len(OPENING) if rest.startswith(OPENING) else HEADER + struct.unpack_from("<I", rest)[0]
            if not conversation.is_keep_alive(rest[:size], False):
                self.steps.append(Step(self.who, False, rest[:size]))
            rest = rest[size:]
        return super().send(data)

    def _take(self, size):
        taken = super()._take(size)
        if taken == OPENING:
            self.steps.append(Step(self.who, True, taken))
        return taken

    def next(self):
        got = super().next()
        data = frame(got.dst, got.src, got.payload, got.kind, got.flags, got.lane)
        if not conversation.is_keep_alive(data, True):
            self.steps.append(Step(self.who, True, data))
        return got

    def event(self, operation):
        return self.next_where(lambda got: got.kind == NS and got.operation == operation)

    def watched(self):
        """The next WATCH_EVENTS, which are answered."""
        self.event(37)
        self.numbered(NS, 13, number(3, 4, 1))

    def numbered(self, kind, operation, body=b""):
        self.requests = getattr(self, "requests", 0) + 1
        return self.ask(kind, operation, body, self.requests)


def ask_about_names(viewer, robot):
    viewer.numbered(NS, 5)
    viewer.numbered(NS, 5, text(3, "robot/**") + number(5, 4, 1) + number(6, 1, True))
    viewer.numbered(NS, 9, text(3, "robot/*"))
    viewer.numbered(NS, 3, text(3, "robot"))
    viewer.numbered(NS, 3, text(3, "nobody"))
    viewer.numbered(NS, 4, number(3, 4, robot.id))
    viewer.numbered(NS, 999)
    viewer.numbered(NS, 6, number(3, 4, 1) + number(5, 2, 3))
    viewer.watched()


def exchange_messages(viewer, robot, odom, chart, drive):
    viewer.numbered(NS, 10, text(3, "robot/odom"))
    robot.event(33)
    viewer.numbered(NS, 10, text(3, "robot/map") + number(4, 4, 1) + number(5, 4, 2))
    robot.event(33)
    robot.send(robot.frame(odom, b"1 2 3", kind=GROUP))
    viewer.next_data()
    robot.send(robot.frame(chart, b"the hall", kind=GROUP))
    viewer.next_data()
    viewer.send(viewer.frame(0, struct.pack("<B3xIQ", CREDIT, chart, 1), kind=FLOW))
    viewer.send(viewer.frame(drive, b"to who accepts", kind=SERVICE))
    robot.next_data()
    viewer.send(viewer.frame(robot.id, struct.pack("<II", 5, 0) + b"keyed", flags=FLAG_KEYED, lane=0))
    robot.next_data()
    robot.send(robot.frame(2, struct.pack("<II", robot.id, viewer.id) + b"both", kind=LIST))
    robot.next_data()
    viewer.next_data()
    robot.send(robot.frame(7 << 20 | 0xFFFFF, b"all", kind=BROADCAST, lane=2))
    viewer.next_data()
    robot.send(robot.frame(7 << 20 | 99, b"nobody", flags=FLAG_REPORT))
    robot.next_where(lambda got: got.kind == REPORT)


def change_names_and_end_services(viewer, robot, odom, chart):
    viewer.numbered(NS, 11, text(3, "robot/odom"))
    robot.event(33)
    viewer.numbered(NS, 1, text(3, "lookout"))
    viewer.watched()
    viewer.numbered(NS, 1, text(3, "robot"))
    viewer.numbered(NS, 2)
    viewer.watched()
    robot.numbered(NS, 8, number(3, 4, odom))
    viewer.watched()
    robot.numbered(NS, 8, number(3, 4, chart))
    viewer.event(32)
    viewer.watched()
    viewer.numbered(NS, 12, number(3, 4, 1))


def converse(test, hub):
    """The steps of a conversation in which everything happens that one hub can do."""
    steps = []
    robot = Recorded(test, hub, "robot", steps).join("robot", extra=text(8, "a robot"))
    viewer = Recorded(test, hub, "viewer", steps).join("viewer", extra=number(5, 1, True) + number(4, 5, 77))
    offer = text(3, "odom") + number(4, 4, 3) + number(5, 4, 0) + number(6, 2, 0) + number(7, 2, 0) + text(8, "about it")
    odom = robot.numbered(NS, 7, offer)[3]
    offer = text(3, "map") + number(4, 4, 4) + number(5, 4, 0) + number(6, 2, 0) + number(7, 2, 2) + number(10, 4, 2)
    chart = robot.numbered(NS, 7, offer + number(11, 1, True))[3]
    drive = robot.numbered(NS, 7, text(3, "drive") + number(6, 2, 1))[3]
    ask_about_names(viewer, robot)
    exchange_messages(viewer, robot, odom, chart, drive)
    change_names_and_end_services(viewer, robot, odom, chart)
    for operation in (1, 2, 3, 9):
        viewer.numbered(CTRL, operation)
    viewer.numbered(CTRL, 4, number(3, 4, robot.id))
    token = viewer.numbered(NS, 1, text(3, "viewer"))[5]
    admin = Recorded(test, hub, "admin", steps, local=True).join(role=2)
    admin.numbered(CTRL, 8, text(3, "error"))
    admin.numbered(CTRL, 7)
    admin.numbered(CTRL, 5, number(3, 4, viewer.id) + number(4, 4, RENUMBERED))
    viewer.until_closed()
    again = Recorded(test, hub, "again", steps).join("viewer", token=token)
    admin.numbered(CTRL, 4, number(3, 4, again.id) + text(4, "enough"))
    again.until_closed()
    robot.send(robot.frame(0, control(GOODBYE, number(1, 3, 0)), kind=LINK))
    robot.until_closed()
    return steps


class Stage:
    """Where a scene is played to be recorded."""

    def __init__(self, test, hub):
        self.test, self.hub, self.steps = test, hub, []

    def client(self, who):
        return Recorded(self.test, self.hub, who, self.steps, local=who == "admin")

    def cut(self, client):
        self.steps.append(Step(client.who, False, b""))
        cut(self.test, self.hub, client, client.who)


class Player:
    """Plays the nodes' side of a recording."""

    def __init__(self, test, hub):
        self.test, self.hub = test, hub
        self.clients, self.tokens = {}, {}

    def client(self, who):
        if who not in self.clients:
            self.clients[who] = Client(self.test, self.hub, local=who == "admin")
        return self.clients[who]

    def say(self, step):
        if step.is_break:
            return cut(self.test, self.hub, self.client(step.who), step.who)
        data = step.data
        for recorded, now in self.tokens.items():
            data = data.replace(recorded, now)
        return self.client(step.who).send(data)

    def hear(self, step):
        client = self.client(step.who)
        if step.is_opening:
            return Step(step.who, True, client._take(len(OPENING)))
        while True:
            got = client.next()
            data = frame(got.dst, got.src, got.payload, got.kind, got.flags, got.lane)
            if conversation.is_keep_alive(data, True):
                continue
            if got.kind == LINK and got.operation == WELCOME:
                client.id = got.dst
            heard = Step(step.who, True, data)
            self.note_token(step, heard)
            return heard

    def note_token(self, recorded, heard):
        """And epochs: nodes say again what they were told."""
        keys = {(LINK, WELCOME): (2, 5), (NS, 0x8001): (5,), (NS, 0x8002): (5,)}
        for key in keys.get((recorded.kind, self.operation(recorded)), ()):
            then, now = (dict((k, v) for k, _, v in conversation.values(step.data[HEADER + 4:])).get(key)
                         for step in (recorded, heard))
            if then and now:
                self.test.assertEqual(len(then), len(now), "tokens of the same size")
                self.tokens[then] = now

    @staticmethod
    def operation(step):
        return step.operation if step.kind in (LINK, NS, CTRL) else None


class Conversation(unittest.TestCase):
    def test_the_hub_of_today_answers_as_it_did(self):
        player = self.play(RECORDING)
        sent, got = ({who: getattr(client, frames) for who, client in player.clients.items()}
                     for frames in ("frames_sent", "frames_got"))
        # A list of two, and a frame for nobody. The viewer asked for resume, and left without a word on what it had got.
        player.hub.expect_ledger(self, accepted=sum(sent.values()), copies=1, delivered=sum(got.values()) - got["viewer"],
                                 dropped={"no_such_node": 1, "link_unsure": got["viewer"]})

    def test_the_hub_of_today_plays_each_scene_as_it_did(self):
        for name, scene in SCENES.items():
            with self.subTest(scene=name):
                self.play(RECORDINGS / f"version_1_{name}.txt", *scene.arguments)

    def test_the_scenes_have_what_they_are_for(self):
        for name, scene in SCENES.items():
            words = {("<" if step.from_hub else ">") + step.words()
                     for step in conversation.load(RECORDINGS / f"version_1_{name}.txt")}
            self.assertEqual(set(scene.has) - words, set(), f"not in {name}, of {words}")

    def play(self, recording, *arguments):
        player = Player(self, Hub(self, *ARGUMENTS, *arguments))
        for place, step in enumerate(conversation.load(recording)):
            with self.subTest(place=place, who=step.who, what=step.words()):
                if not step.from_hub:
                    player.say(step)
                    continue
                try:
                    heard = player.hear(step)
                except Closed:
                    self.fail("the hub closed the connection")
                then, now = conversation.stable(step), conversation.stable(heard)
                self.assertEqual((now[0], now[2]), (then[0], then[2]))
                self.assertTrue(conversation.covers(now[1], then[1]), f"{now[1]} lacks something of {then[1]}")
        return player

    def test_the_recording_is_whole(self):
        steps = conversation.load(RECORDING)
        said = {(step.kind, step.operation) for step in steps if not step.is_opening and step.kind in (LINK, NS, CTRL)}
        requests = {(NS, operation) for operation in range(1, 14)} | {(CTRL, op) for op in (1, 2, 3, 4, 5, 7, 8, 9)}
        events = {(NS, operation) for operation in (32, 33, 37)}
        links = {(LINK, operation) for operation in (1, 2, 3)}
        answers = {(kind, operation | 0x8000) for kind, operation in requests}
        self.assertEqual(requests | events | links | answers - said, requests | events | links)
        self.assertLessEqual(requests | events | links | answers, said)
        kinds = {step.kind for step in steps if not step.is_opening}
        self.assertLessEqual({UNICAST, GROUP, LIST, BROADCAST, SERVICE, REPORT, FLOW}, kinds)

    def test_a_difference_is_found(self):
        answer = Step("x", True, frame(1, 0, control(0x8003, number(1, 3, 0) + number(3, 4, 5), 1), kind=NS))
        other = Step("x", True, frame(1, 0, control(0x8003, number(1, 3, 0) + number(3, 4, 6), 1), kind=NS))
        more = Step("x", True, frame(1, 0, control(0x8003, number(1, 3, 0) + number(3, 4, 5) + text(9, "new"), 1), kind=NS))
        self.assertFalse(conversation.covers(conversation.stable(other)[1], conversation.stable(answer)[1]))
        self.assertTrue(conversation.covers(conversation.stable(more)[1], conversation.stable(answer)[1]))
        self.assertFalse(conversation.covers(conversation.stable(answer)[1], conversation.stable(more)[1]))
        record = Step("x", True, frame(1, 0, control(0x8005, number(1, 3, 0) + value(3, 14, number(1, 4, 5)), 1), kind=NS))
        another = Step("x", True, frame(1, 0, control(0x8005, number(1, 3, 0) + value(3, 14, number(1, 4, 6)), 1), kind=NS))
        self.assertFalse(conversation.covers(conversation.stable(another)[1], conversation.stable(record)[1]))


class Record(unittest.TestCase):
    name = ""

    def test_record(self):
        if not self.name:
            return conversation.save(RECORDING, TITLE, converse(self, Hub(self, *ARGUMENTS)))
        scene = SCENES[self.name]
        stage = Stage(self, Hub(self, *ARGUMENTS, *scene.arguments))
        scene.play(stage)
        return conversation.save(RECORDINGS / f"version_1_{self.name}.txt", scene.title, stage.steps)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--record"]:
        Record.name = " ".join(sys.argv[2:])
        unittest.main(argv=sys.argv[:1], defaultTest="Record")
    else:
        unittest.main(defaultTest="Conversation")
