#!/usr/bin/env python3
"""After a fork: what is of the parent is refused in the child, which connects anew."""

import unittest

from support.waiting import PATIENCE_S
from two_nodes import OneHub, program


class Fork(OneHub):
    def test_a_child_of_fork_connects_anew(self):
        lines = """
publisher, peer = node.advertise("p"), node.id
if os.fork() == 0:
    for call in (lambda: publisher.publish("x"), node.state, lambda: node.subscribe("a/b")):
        try: call()
        except gimnet.Forked: print("forked")
    with gimnet.connect("child", hub=%r) as child: print(child.find("a") == peer)
    sys.exit(0)
os.wait()
print(publisher.publish("x"))
""" % self.hub.url
        out = self.ends(program(lines, self.hub, "a"), 0).split()
        self.assertEqual(out, ["forked"] * 3 + ["True"] * 2)

    def test_a_child_of_fork_has_nothing_of_its_parent(self):
        """The messages that it fetched ahead are of the parent, and so are the locks that its threads hold."""
        lines = f"""
import signal
views = gimnet.connect("views", hub=hub)
publisher, subscription, waits = node.advertise("p"), views.subscribe("a/p"), gimnet.WaitSet()
publisher.wait_for_subscribers(1, {PATIENCE_S})
while not subscription.has_ready():
    publisher.publish("1"), publisher.publish("2"), subscription.receive({PATIENCE_S})
os.kill({self.hub.process.popen.pid}, signal.SIGSTOP)
opened, sending = node._opened, threading.Event()
node._opened = lambda *arguments: (sending.set(), opened(*arguments))[1]
def send():
    try: node.send("b/nobody", "x", {PATIENCE_S})
    except gimnet.NotFound: pass
thread = threading.Thread(target=send)
thread.start()
sending.wait()
child = os.fork()
if child == 0:
    signal.alarm({PATIENCE_S:.0f})
    calls = dict(receive=lambda: subscription.receive(0), send=lambda: node.send("b/nobody", "x"), id=lambda: node.id,
                 subscribers=lambda: publisher.subscribers, unsent=lambda: publisher.unsent, missed=lambda: subscription.missed,
                 fileno=lambda: subscription.fileno(), add=lambda: gimnet.WaitSet().add(subscription), wait=lambda: waits.wait(0),
                 set_fileno=waits.fileno)
    for name, call in calls.items():
        try: print(name, call())
        except gimnet.Forked: pass
    print("ended", subscription.has_ready(), flush=True)
    os._exit(0)
os.waitpid(child, 0)
os.kill({self.hub.process.popen.pid}, signal.SIGCONT)
thread.join()
"""
        self.assertEqual(self.ends(program(lines, self.hub, "a"), 0), "ended False\n")

    def test_multiprocessing_works_in_each_way_to_start(self):
        for method in ("fork", "spawn", "forkserver"):
            with self.subTest(method):
                lines = f"""
import multiprocessing
from operator import methodcaller
if __name__ == "__main__":
    context = multiprocessing.get_context({method!r})
    with context.Pool(1) as pool:
        print(pool.apply(eval, ("__import__('gimnet').connect('child', hub={self.hub.url!r}).name",)))
"""
                self.assertEqual(self.ends(program(lines, self.hub, "a"), 0), "child\n")


if __name__ == "__main__":
    unittest.main()
