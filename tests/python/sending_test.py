#!/usr/bin/env python3
"""send() and publish() while the hub is away: each message that was not sent is counted once."""

import unittest

import gimnet
from support.proxy import Proxy
from support.waiting import PATIENCE_S
from two_nodes import TwoNodes

AWAY_S = 0.5
GOES_ON = "the hub is back, and the session goes on"


class HubAway(TwoNodes):
    """The viewer's connection can be broken."""

    def setUp(self):
        super().setUp()
        self.drive = self.robot.accept("drive")
        self.proxy = Proxy(self, self.hub.port)
        self.sender = gimnet.connect("sender", hub=self.proxy.url)
        self.addCleanup(self.sender.close)
        self.events = self.sender.watch_connection()
        self.assertEqual(self.events.receive(PATIENCE_S).change, "connected")
        self.sender.send("robot/drive", "first", PATIENCE_S)
        self.assertEqual(self.drive.receive(PATIENCE_S).text, "first")

    def break_for(self, seconds):
        self.proxy.break_for(seconds)
        self.assertEqual(self.events.receive(PATIENCE_S).change, "lost")

    def words_after_the_break(self):
        self.proxy.break_for(0)
        event = self.events.receive(PATIENCE_S)
        self.assertEqual(event.change, "resumed")
        return event.why

    def test_a_message_that_goes_when_the_hub_is_back_is_not_counted(self):
        self.break_for(AWAY_S)
        self.sender.send("robot/drive", "second", PATIENCE_S)
        self.assertEqual(self.drive.receive(PATIENCE_S).text, "second")
        event = self.events.receive(PATIENCE_S)
        self.assertEqual((event.change, event.why), ("resumed", GOES_ON))

    def test_a_message_that_was_given_up_is_counted_once(self):
        self.break_for(2 * PATIENCE_S)
        with self.assertRaisesRegex(gimnet.Timeout, "the hub has been away for"):
            self.sender.send("robot/drive", "second", 0.2)
        self.assertEqual(self.words_after_the_break(), GOES_ON + "; 1 message was not sent meanwhile")

    def test_a_message_that_is_tried_again_is_not_counted(self):
        self.break_for(2 * PATIENCE_S)
        for _ in range(3):
            with self.assertRaises(gimnet.Timeout):
                self.sender.send("robot/drive", "second", 0)
            with self.assertRaises(gimnet.Timeout):
                self.sender.send("robot/drive", "third", 0, confirm=True)
        self.assertEqual(self.words_after_the_break(), GOES_ON)

    def test_each_message_that_was_not_published_is_counted(self):
        pose = self.sender.advertise("pose", retain=True)
        self.break_for(2 * PATIENCE_S)
        self.assertEqual([pose.publish("x 1") for _ in range(54)], [False] * 54)
        self.assertEqual(self.words_after_the_break(), GOES_ON + "; 54 messages were not sent meanwhile")

    def test_a_subscriber_misses_nothing_that_was_not_published(self):
        pose = self.sender.advertise("pose")
        poses = self.robot.subscribe("sender/pose")
        pose.wait_for_subscribers(1, PATIENCE_S)
        pose.publish("first")
        self.break_for(2 * PATIENCE_S)
        self.assertEqual([pose.publish("x 1") for _ in range(54)], [False] * 54)
        self.words_after_the_break()
        pose.publish("second")
        self.assertEqual([poses.receive(PATIENCE_S).text for _ in range(2)], ["first", "second"])
        self.assertEqual(poses.missed, 0)


if __name__ == "__main__":
    unittest.main()
