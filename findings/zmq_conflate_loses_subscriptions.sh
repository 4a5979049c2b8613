#!/bin/sh
# ZeroMQ (pyzmq 27.3.0, libzmq 4.3.5): `CONFLATE` keeps the newest message only, as a controller wants it. It does so in both directions, and subscriptions go to the publisher as messages: of two that are made before
# `connect` one arrives. The other topic is never heard, however slowly it is sent and read; setsockopt and getsockopt say nothing.
# Expected: both topics, or the newest message of either. Seen: a subscriber of "joint" and "imu", which are sent in turn, 50 ms apart, and read after each, hears "joint" only, in either order of the two calls; with one
# subscription for all (b"") or without CONFLATE both. Set after `connect`, CONFLATE does nothing, without an error, though getsockopt says 1: all messages wait in line. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pyzmq==27.3.0
"$folder/env/bin/python" - <<'CODE'
import sys
import time

import zmq

context = zmq.Context()
publisher = context.socket(zmq.PUB)
port = publisher.bind_to_random_port("tcp://127.0.0.1")


def subscriber(topics, conflate):
    socket = context.socket(zmq.SUB)
    for topic in topics:
        socket.setsockopt(zmq.SUBSCRIBE, topic)
    if conflate == "before":
        socket.setsockopt(zmq.CONFLATE, 1)
    socket.connect(f"tcp://127.0.0.1:{port}")
    if conflate == "after":
        socket.setsockopt(zmq.CONFLATE, 1)
    return socket


sockets = {
    "joint, imu": subscriber((b"joint", b"imu"), "before"),
    "imu, joint": subscriber((b"imu", b"joint"), "before"),
    "everything": subscriber((b"",), "before"),
    "no CONFLATE": subscriber((b"joint", b"imu"), "never"),
}
unread = subscriber((b"joint", b"imu"), "after")
time.sleep(0.5)  # until the publisher knows them
heard = {name: [] for name in sockets}
for tick in range(5):
    for topic in ("joint", "imu"):
        publisher.send(f"{topic} {tick}".encode())
        time.sleep(0.05)
        for name, socket in sockets.items():
            if socket.poll(0):
                heard[name].append(socket.recv().decode())
for name, messages in heard.items():
    print(f"libzmq {zmq.zmq_version()}, subscribed to {name}: CONFLATE {sockets[name].getsockopt(zmq.CONFLATE)}, heard {messages}")
late = 0
while unread.poll(100):
    late += bool(unread.recv())
print(f"CONFLATE set after connect: getsockopt says {unread.getsockopt(zmq.CONFLATE)}, {late} messages in line")
one, both = [f"joint {tick}" for tick in range(5)], [f"{topic} {tick}" for tick in range(5) for topic in ("joint", "imu")]
sys.exit(0 if heard == {"joint, imu": one, "imu, joint": one, "everything": both, "no CONFLATE": both} and late == 10 else 1)
CODE
