"""One of two Python programs that talk by means of a library: python_pair.py LIBRARY URL BYTES COUNT (send | receive | proxy). The
receiver says that it is ready, and then how many seconds it took from the first message to the last. perf/driver/python.py starts
them. At most WINDOW messages are under way in each: that of the receiver asks for more, so that nothing is lost."""

import sys
import threading
import time

UNDER_WAY = 2 << 20
WINDOW_MAX = 1000
PATIENCE_SECONDS = 60


def gimnet_side(url, size, role):
    import gimnet
    node = gimnet.connect(role, hub=url)
    if role == "send":
        data, more = node.advertise("data"), node.subscribe("receive/more")
        data.wait_for_subscribers(1, PATIENCE_SECONDS)
        return data.publish, lambda: more.receive(PATIENCE_SECONDS).data
    more, data = node.advertise("more"), node.subscribe("send/data", queue=2 * WINDOW_MAX)
    return more.publish, lambda: data.receive(PATIENCE_SECONDS).data


def paho_side(url, size, role):
    import queue
    import paho.mqtt.client
    got, subscribed = queue.SimpleQueue(), threading.Event()
    client = paho.mqtt.client.Client()
    client.max_queued_messages_set(0)
    client.on_message = lambda *arguments: got.put(arguments[2].payload)
    client.on_subscribe = lambda *_: subscribed.set()
    host, port = url.split("//")[1].split(":")
    client.connect(host, int(port))
    client.loop_start()
    mine, other = ("more", "data") if role == "send" else ("data", "more")
    client.subscribe(mine)
    subscribed.wait(PATIENCE_SECONDS)
    return lambda data: client.publish(other, data), lambda: got.get(timeout=PATIENCE_SECONDS)


def pyzmq_side(url, size, role):
    import zmq
    context = zmq.Context.instance()
    if role == "proxy":
        inside, outside = context.socket(zmq.XSUB), context.socket(zmq.XPUB)
        for side, place in ((inside, ".in"), (outside, ".out")):
            side.set_hwm(0)
            side.bind(url + place)
        print("ready", flush=True)
        zmq.proxy(inside, outside)
    publisher, subscriber = context.socket(zmq.PUB), context.socket(zmq.SUB)
    mine, other = (b"m", b"d") if role == "send" else (b"d", b"m")
    for side, place in ((publisher, ".in"), (subscriber, ".out")):
        side.set_hwm(0)
        side.connect(url + place)
    subscriber.subscribe(mine)
    subscriber.rcvtimeo = PATIENCE_SECONDS * 1000

    def take():
        return subscriber.recv_multipart(copy=size < 65536)[1]

    return lambda data: publisher.send_multipart([other, data], copy=size < 65536), take


def main(library, url, size, count, role):
    size, count = int(size), int(count)
    put, take = {"gimnet": gimnet_side, "paho": paho_side, "pyzmq": pyzmq_side}[library](url, size, role)
    window = max(2, min(WINDOW_MAX, UNDER_WAY // size))
    if role == "receive":
        # The sender comes later: it is told to begin until it does.
        print("ready", flush=True)
        first = threading.Event()
        threading.Thread(target=lambda: [put(b"begin") for _ in iter(lambda: first.wait(0.05), True)], daemon=True).start()
        for number in range(count):
            data = take()
            if number == 0:
                first.set()
                begin = time.monotonic()
            if int.from_bytes(bytes(memoryview(data)[:8]), "little") != number or len(memoryview(data)) != size:
                sys.exit(f"{library}: a message was lost or another came instead of {number}")
            if number % window == window // 2:
                put(b"more")
        print(time.monotonic() - begin, flush=True)
        return
    while bytes(memoryview(take())) != b"begin":
        pass
    allowed = window
    content = bytearray(size)
    for number in range(count):
        while number >= allowed:
            allowed += window if bytes(memoryview(take())) == b"more" else 0
        content[:8] = number.to_bytes(8, "little")
        put(bytes(content) if size < 65536 or library == "pyzmq" else content)
    threading.Event().wait()  # what is under way is not lost; this is killed when all has come


main(*sys.argv[1:])
