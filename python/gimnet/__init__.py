"""GIMnet for Python: a network for robots.

    import gimnet
    with gimnet.connect("robot") as node:
        node.advertise("pose").publish({"x": 1.5, "y": 2.0})

    with gimnet.connect() as node:
        for message in node.subscribe("robot/pose"):
            print(message.value["x"])

Times are in seconds. Everything may be used by any thread. After a fork the child connects anew.
"""

from .bitestream import BitestreamError, Time
from .errors import (BadArgument, BadName, BadVersion, Busy, Closed, Denied, Expired, Failed, Forked, GimnetError, Gone, Limit, NameTaken,
                     NoHost, NoHub, NoRight, NotConnected, NotDelivered, NotFound, NotRetained, NotTrusted, Protocol,
                     Refused, Silence, System, Taken, Timeout, TooLarge, WindowFull)
from .messages import Age, Event, Message, NodeRecord, Peer, ServiceRecord
from .node import ConnectionEvent, ConnectionWatch, Node, Publisher, Source, State, Watch, connect
from .requests import Answers, Pending, Reply, Request
from .wait_set import WaitSet

__all__ = [
    "Age", "Answers", "BadArgument", "BadName", "BadVersion", "BitestreamError", "Busy", "Closed", "ConnectionEvent", "ConnectionWatch", "Denied", "Event", "Expired",
    "Failed", "Forked", "GimnetError", "Gone", "Limit", "Message", "NameTaken", "NoHost", "NoHub", "NoRight", "Node", "NodeRecord", "NotConnected",
    "NotDelivered", "NotFound", "NotRetained", "NotTrusted", "Peer", "Pending", "Protocol", "Publisher", "Refused", "Reply",
    "Request", "ServiceRecord", "Silence",
    "Source", "State", "System", "Taken", "Time", "Timeout", "TooLarge", "WaitSet", "Watch", "WindowFull", "connect",
]
