#!/usr/bin/env python3
"""Ids and names over crashes: tokens, restarts of the hub, programs that were killed, connections that drop."""

import json
import os
import signal
import struct
import time
import unittest

from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.proxy import Proxy
from support.waiting import wait_until
from support.wire import (FLAG_KEYED, FLAG_REPORT, GOODBYE, GROUP, LINK, NS, OPENING, REPORT, SERVICE, WELCOME, Client,
                          Closed, control, frame, hello, number, text, value)

RESOLVE, ADVERTISE, SUBSCRIBE = 3, 7, 10
ACCEPTS = text(3, "drive") + number(6, 2, 1)  # a service that takes data
# Nobody is silent too long: who does not read here does not answer PING either.
PATIENT = ("--limit", "silent_ms=3000000", "--limit", "keep_alive_ms=600000")
NO_SUCH_NODE, AWAY, NOT_ALLOWED, NO_SUCH_GROUP = 1, 3, 9, 13  # the reasons of REPORTs


def resolve(client, name):
    return client.ask(NS, RESOLVE, text(3, name))[3]


def resolved(hub):
    """How often the hub was asked for a name's id."""
    return hub.status()["counters"].get("names.resolve", 0)


def node_id(text_form):
    hub, index = text_form.split(".")
    return int(hub) << 20 | int(index)


def id_of(hub, name):
    return node_id(hub.wait_for_node(name)["id"])


def is_served(client):
    try:
        return resolve(client, "B") == client.id
    except (Closed, OSError):
        return False


def message(client, target, sequence, data):
    """A GIMI message without an ACK, as `gimnet recv` takes it."""
    return client.frame(target, struct.pack("<IIIIBBH", 0, 0, 1, sequence, 0, 0, 0) + data, flags=FLAG_KEYED)


class Restart(unittest.TestCase):
    def kill(self, hub):
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()

    def test_nodes_come_back_under_their_ids_and_newcomers_get_others(self):
        hub = Hub(self)
        j = start_recv(self, hub, "J")
        k = start_recv(self, hub, "K")
        peer = Client(self, hub).join("peer")
        j_id, k_id = resolve(peer, "J"), resolve(peer, "K")
        k.signal(signal.SIGSTOP)  # so that Z is first
        j.signal(signal.SIGKILL)
        self.kill(hub)
        hub = hub.again(self)
        z = Client(self, hub).join("Z")
        k.signal(signal.SIGCONT)
        self.assertEqual(id_of(hub, "K"), k_id)
        self.assertNotIn(z.id, (j_id, k_id))
        # Who knew K's id sends at once.
        again = Client(self, hub).join("peer", token=peer.welcome[2])
        self.assertEqual(again.id, peer.id)
        again.send(message(again, k_id, 1, b"still you"))
        wait_until(lambda: k.out == b"still you\n", "the message at K")
        self.assertEqual(resolved(hub), 0)
        # J may still come: it is away, not unknown.
        again.send(again.frame(j_id, b"?", flags=FLAG_REPORT))
        self.assertEqual(again.next_where(lambda got: got.kind == REPORT).payload[0], AWAY)
        hub.expect_ledger(self, accepted=again.frames_sent, delivered=1, dropped={"away": 1})
        # J was killed with the hub; started again, it has its id and name, too.
        start_recv(self, hub, "J")
        self.assertEqual(id_of(hub, "J"), j_id)

    def test_one_that_was_given_a_high_id_is_away_until_it_is_back(self):
        hub = Hub(self)
        k = start_recv(self, hub, "K")
        peer = Client(self, hub).join("peer")
        given = run_gimnet(f"unix:{hub.socket_path}", "ctl", "reassign", "K", "7.900000")
        self.assertEqual(given.code, 0, given.err)
        wait_until(lambda: any(node["id"] == "7.900000" and node["connected"] for node in hub.nodes()), "K as 7.900000")
        k.signal(signal.SIGSTOP)
        self.kill(hub)
        hub = hub.again(self)
        again = Client(self, hub).join("peer", token=peer.welcome[2])
        # What was handed out before the restart decides, not where: the index beside it was nobody's.
        for target, reason in ((node_id("7.900000"), AWAY), (node_id("7.900001"), NO_SUCH_NODE)):
            again.send(again.frame(target, b"?", flags=FLAG_REPORT))
            self.assertEqual(again.next_where(lambda got: got.kind == REPORT).payload[0], reason, hex(target))
        k.signal(signal.SIGCONT)
        self.assertEqual(id_of(hub, "K"), node_id("7.900000"))
        again.send(message(again, node_id("7.900000"), 1, b"still you"))
        wait_until(lambda: k.out == b"still you\n", "the message at K")
        hub.expect_ledger(self, accepted=again.frames_sent, delivered=1, dropped={"away": 1, "no_such_node": 1})

    def test_restarts_do_not_use_up_what_was_handed_out(self):
        hub = Hub(self)
        first = Client(self, hub).join()
        ids = {first.id}
        for _ in range(3):
            self.kill(hub)
            hub = hub.again(self)
            newcomer = Client(self, hub).join()
            self.assertNotIn(newcomer.id, ids)
            ids.add(newcomer.id)
        self.assertEqual(Client(self, hub).join(token=first.welcome[2]).id, first.id)

    def test_services_come_back_under_another_group(self):
        hub = Hub(self)
        provider = start_gimnet(self, hub, "pub", "A/odom", stdin=-1)
        watcher = start_gimnet(self, hub, "echo", "A/odom", "--raw")

        def service():
            found = json.loads(run_gimnet(hub, "services", "--json").out)
            return found[0] if found and found[0]["subscribers"] == 1 else None
        before = wait_until(service, "the service and its subscriber")
        self.kill(hub)
        hub = hub.again(self)
        newcomer = Client(self, hub).join("first")
        newcomer.ask(NS, 7, text(3, "other"))
        after = wait_until(lambda: next((s for s in json.loads(run_gimnet(hub, "services", "--json").out)
                                         if s["name"] == "A/odom" and s["subscribers"] == 1), None), "A/odom again")
        self.assertNotEqual(after["group"], before["group"])
        provider.popen.stdin.write(b"go on\n")
        provider.popen.stdin.flush()
        wait_until(lambda: watcher.out.endswith(b"go on\n"), "the message at the subscriber")
        hub.expect_ledger(self, accepted=1, delivered=1)


    def test_a_group_of_the_former_hub_is_nobodys(self):
        hub = Hub(self, *PATIENT)
        owner, thief, peer = Client(self, hub).join("V"), Client(self, hub).join("M"), Client(self, hub).join("P")
        drive, odom = owner.ask(NS, ADVERTISE, ACCEPTS)[3], owner.ask(NS, ADVERTISE, text(3, "odom"))[3]
        peer.ask(NS, SUBSCRIBE, text(3, "V/odom"))
        self.kill(hub)
        hub = hub.again(self)
        # M and P are back before V.
        thief = Client(self, hub).join("M", token=thief.welcome[2])
        peer = Client(self, hub).join("P", token=peer.welcome[2])
        peer.ask(NS, SUBSCRIBE, text(3, "V/odom"))
        stolen = {thief.ask(NS, ADVERTISE, body)[3] for body in (ACCEPTS, text(3, "odom"))}
        self.assertFalse({drive, odom} & stolen, "M has a group that was given before")
        for group in (drive, odom):
            thief.send(thief.frame(group, b"as if of V", kind=GROUP, flags=FLAG_REPORT))
            self.assertEqual(thief.next_where(lambda got: got.kind == REPORT).payload[0], NO_SUCH_GROUP)
        peer.send(peer.frame(drive, b"for V", kind=SERVICE, flags=FLAG_REPORT))
        self.assertEqual(peer.next_where(lambda got: got.kind == REPORT).payload[0], NO_SUCH_GROUP)
        owner = Client(self, hub).join("V", token=owner.welcome[2])
        drive, odom = (owner.ask(NS, ADVERTISE, body)[3] for body in (ACCEPTS, text(3, "odom")))
        peer.send(peer.frame(drive, b"for V", kind=SERVICE))
        self.assertEqual(owner.next_data().payload, b"for V")
        thief.send(thief.frame(odom, b"as if of V", kind=GROUP, flags=FLAG_REPORT))
        self.assertEqual(thief.next_where(lambda got: got.kind == REPORT).payload[0], NOT_ALLOWED)
        owner.send(owner.frame(odom, b"of V", kind=GROUP))
        got = peer.next_data()
        self.assertEqual((got.src, got.payload), (owner.id, b"of V"))
        hub.expect_ledger(self, accepted=6, delivered=2, dropped={"no_such_group": 3, "not_allowed": 1})


class Programs(unittest.TestCase):
    def test_one_that_was_killed_has_its_id_and_name_at_once(self):
        hub = Hub(self)
        for url in hub.addresses:
            receiver = start_recv(self, url_hub(hub, url), "B")
            before = id_of(hub, "B")
            receiver.signal(signal.SIGKILL)
            receiver.wait()
            again = start_recv(self, url_hub(hub, url), "B")
            self.assertEqual(id_of(hub, "B"), before)
            again.signal(signal.SIGTERM)
            again.wait()

    def test_a_second_one_beside_it_is_refused_with_holder_place_and_age(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B")
        before = id_of(hub, "B")
        rival = run_gimnet(hub, "recv", "--name", "B")
        self.assertNotEqual(rival.code, 0)
        holder = f"held by node 7.{before & 0xFFFFF}"
        for part in (holder, "connected over tcp from 127.0.0.1:", "since "):
            self.assertIn(part, rival.err)
        self.assertEqual(id_of(hub, "B"), before)
        self.assertIsNone(receiver.popen.poll())

    def test_a_hundred_dropped_connections_cost_no_id_no_message_and_no_lookup(self):
        hub = Hub(self, "--limit", "silent_ms=60000")
        proxy = Proxy(self, hub.port)
        names = [f"r{number}" for number in range(10)]
        receivers = [start_gimnet(self, proxy, "recv", "--name", name, "--raw") for name in names]
        ids = [id_of(hub, name) for name in names]
        peer = Client(self, hub).join("peer")
        for turn in range(10):
            proxy.drop_all()
            for target in ids:
                peer.send(message(peer, target, turn + 1, b"%d" % turn))
            peer.ping()
            expected = b"".join(b"%d\n" % number for number in range(turn + 1))
            for receiver in receivers:
                wait_until(lambda r=receiver: r.out == expected, f"{expected} at every receiver")
        self.assertGreaterEqual(proxy.dropped, 100)
        self.assertEqual(peer.frames_sent, 100)
        hub.expect_ledger(self, accepted=peer.frames_sent, delivered=sum(r.out.count(b"\n") for r in receivers))
        self.assertEqual([id_of(hub, name) for name in names], ids)
        self.assertEqual(resolved(hub), 0)


class Tokens(unittest.TestCase):
    def test_one_bit_changed_counts_as_none(self):
        hub = Hub(self)
        first = Client(self, hub).join("B")
        token = first.welcome[2]
        first.socket.close()
        wait_until(lambda: any(not node["connected"] for node in hub.nodes()), "B away")
        for bit in (0, 40, 100, 150, 8 * len(token) - 1):
            forged = bytearray(token)
            forged[bit // 8] ^= 1 << bit % 8
            other = Client(self, hub).join(token=bytes(forged))
            self.assertNotEqual(other.id, first.id, f"bit {bit}")
        self.assertEqual(Client(self, hub).join("B", token=token).id, first.id)

    def test_junk_counts_as_none(self):
        hub = Hub(self)
        first = Client(self, hub).join()
        token = first.welcome[2]
        for junk in (b"\x00", bytes(56), os.urandom(56), os.urandom(128), token[:-1], token[1:], token + b"\x00"):
            self.assertNotEqual(Client(self, hub).join(token=junk).id, first.id)
        too_long = Client(self, hub)
        too_long.send(OPENING + hello(token=bytes(129)))
        self.assertEqual(too_long.first_answer().goodbye, "malformed")

    def test_of_two_who_show_one_at_once_one_has_the_session(self):
        hub = Hub(self)
        token = Client(self, hub).join("B").welcome[2]
        claimants = [Client(self, hub) for _ in range(2)]
        for claimant in claimants:
            claimant.send(OPENING + hello("B", token=token))
        for claimant in claimants:
            answer = claimant.first_answer()
            self.assertEqual(answer.operation, WELCOME)
            claimant.id = answer.dst
        self.assertEqual(claimants[0].id, claimants[1].id)
        wait_until(lambda: sum(node["name"] == "B" and node["connected"] for node in hub.nodes()) == 1, "one B")
        self.assertEqual(sum(is_served(claimant) for claimant in claimants), 1)

    def test_an_expired_one_counts_as_none(self):
        token_ms = 1000
        while True:
            hub = Hub(self, "--limit", f"token_ms={token_ms}")
            began = time.monotonic()
            first = Client(self, hub).join()
            if Client(self, hub).join(token=first.welcome[2]).id == first.id:
                break
            # On a machine that is slower than the token is good, a longer one is tried.
            self.assertGreater(time.monotonic() - began, 0.9 * token_ms / 1000, "a good token counted as none")
            token_ms *= 4
        # Each try takes the session over; only the first token's time decides.
        wait_until(lambda: Client(self, hub).join(token=first.welcome[2]).id != first.id, "the token expired")

    def test_one_of_another_identity_counts_as_none(self):
        hub = Hub(self)
        over_tcp = Client(self, hub).join()
        over_unix = Client(self, hub, local=True).join()
        self.assertNotEqual(Client(self, hub, local=True).join(token=over_tcp.welcome[2]).id, over_tcp.id)
        self.assertNotEqual(Client(self, hub).join(token=over_unix.welcome[2]).id, over_unix.id)
        self.assertEqual(Client(self, hub, local=True).join(token=over_unix.welcome[2]).id, over_unix.id)

    def test_a_replayed_hello_takes_the_session_only_while_its_token_is_good(self):
        hub = Hub(self)
        first = Client(self, hub).join("B")
        recorded = OPENING + hello("B", token=first.welcome[2])

        def replay(local=False):
            thief = Client(self, hub, local=local)
            thief.send(recorded)
            return thief.first_answer()
        owner = Client(self, hub).join("B", token=first.welcome[2])
        self.assertEqual(first.goodbye(), "replaced")
        # What a token proves is that the hub gave it to that identity: on TCP everybody is the same one.
        self.assertEqual(replay(local=True).goodbye, "name_taken")
        taken = replay()
        self.assertEqual((taken.operation, taken.dst), (WELCOME, owner.id))
        self.assertEqual(owner.goodbye(), "replaced", "the owner is told")
        # Each WELCOME has a token of its own, but those before it stay good.
        owner = Client(self, hub).join("B", token=owner.welcome[2])
        self.assertEqual(owner.id, first.id)
        owner.send(frame(0, owner.id, control(GOODBYE, number(1, 3, 0)), kind=LINK))
        owner.until_closed()
        late = replay()
        self.assertEqual(late.operation, WELCOME)
        self.assertNotEqual(late.dst, first.id, "after the owner's GOODBYE it is a HELLO as any")

    def test_a_replayed_hello_without_a_token_gets_no_name_that_is_held(self):
        hub = Hub(self)
        Client(self, hub).join("B")
        replayed = Client(self, hub)
        replayed.send(OPENING + hello("B"))
        self.assertEqual(replayed.first_answer().goodbye, "name_taken")

    def test_goodbye_frees_id_and_name_at_once(self):
        hub = Hub(self)
        first = Client(self, hub).join("B")
        first.send(frame(0, first.id, control(GOODBYE, number(1, 3, 0)), kind=LINK))
        first.until_closed()
        second = Client(self, hub).join("B", token=first.welcome[2])
        self.assertNotEqual(second.id, first.id)
        self.assertEqual([node["name"] for node in hub.nodes() if node["name"]], ["B"])

    def kicked(self, hub, name):
        """Id and token of a node that an administrator kicked."""
        node = Client(self, hub).join(name)
        done = run_gimnet(f"unix:{hub.socket_path}", "ctl", "kick", name)
        self.assertEqual(done.code, 0, done.err)
        self.assertEqual(node.goodbye(), "kicked")
        return node.id, node.welcome[2]

    def test_one_of_a_kicked_node_counts_as_none(self):
        hub = Hub(self)
        former, token = self.kicked(hub, "B")
        again = Client(self, hub).join("B", token=token)
        self.assertNotEqual(again.id, former)
        self.assertNotEqual(Client(self, hub).join(token=token).id, former)
        # The node that has the name now is nobody that was kicked.
        again.socket.close()
        self.assertEqual(Client(self, hub).join("B", token=again.welcome[2]).id, again.id)

    def test_nor_does_it_count_for_a_hub_that_was_killed_and_started_again(self):
        hub = Hub(self)
        kicked = {name: self.kicked(hub, name) for name in ("B", "C")}
        bystander = Client(self, hub).join("D")
        for _ in range(2):
            hub.process.signal(signal.SIGKILL)
            hub.process.wait()
            hub = hub.again(self)
            for name, (former, token) in kicked.items():
                for wanted in (name, None):
                    client = Client(self, hub).join(wanted, token=token)
                    self.assertNotEqual(client.id, former)
                    client.send(frame(0, client.id, control(GOODBYE, number(1, 3, 0)), kind=LINK)).until_closed()
            again = Client(self, hub).join("D", token=bystander.welcome[2])
            self.assertEqual(again.id, bystander.id, "nobody else lost anything")
            bystander = again

    def test_the_name_of_a_live_node_is_not_given_to_a_token_of_another(self):
        hub = Hub(self)
        first = Client(self, hub).join("A")
        Client(self, hub).join("B")
        client = Client(self, hub)
        client.send(OPENING + hello("B", token=first.welcome[2]))
        answer = client.first_answer()
        self.assertNotEqual(answer.operation, WELCOME)
        self.assertEqual(answer.goodbye, "name_taken")


def url_hub(hub, url):
    """The hub as one of its addresses."""
    class At:
        def __init__(self):
            self.url = url

        def __getattr__(self, name):
            return getattr(hub, name)
    return At()


if __name__ == "__main__":
    unittest.main()
