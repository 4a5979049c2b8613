#!/bin/sh
# Zenoh 1.10.2 (eclipse-zenoh): a subscriber without a handler puts its samples into a queue (FifoChannel), and when nobody reads
# that queue, its 257th sample stops all other subscribers of the session: callbacks on other keys get nothing more, though
# their publisher drops rather than waits. They get what was held back, late, once somebody reads. A queue that nobody reads for a
# while wants `zenoh.handlers.RingChannel`, which loses its oldest samples and stops nobody.
# Seen: 400 pictures and 1,000 IMU samples of one link, pictures unread: the IMU's callback got fewer than 900; with a ring all 1,000.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "eclipse-zenoh==1.10.2"
timeout 60 "$folder/venv/bin/python" - <<'CODE'
import json
import sys
import time

import zenoh

ENDPOINT = "tcp/127.0.0.1:27447"


def session(role):
    config = zenoh.Config()
    for key, value in (
        ("mode", "peer"), ("scouting/multicast/enabled", False), ("scouting/gossip/enabled", False),
        ("listen/endpoints", [ENDPOINT] if role == "listen" else []),
        ("connect/endpoints", [ENDPOINT] if role == "connect" else []),
    ):
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def received(*handler):
    """Count the IMU samples that a callback gets beside an unread subscriber of pictures."""
    with session("listen") as robot, session("connect") as viewer:
        samples = []
        pictures = viewer.declare_subscriber("pictures", *handler)
        imu = viewer.declare_subscriber("imu", samples.append)
        time.sleep(1)
        drop = zenoh.CongestionControl.DROP
        sends_imu = robot.declare_publisher("imu", congestion_control=drop)
        sends_pictures = robot.declare_publisher("pictures", congestion_control=drop)
        for tick in range(1000):
            sends_imu.put(bytes(64))
            if tick % 5 < 2:
                sends_pictures.put(bytes(64))
            time.sleep(0.001)
        time.sleep(1)
        before = len(samples)
        end = time.monotonic() + 3
        while len(samples) < 1000 and time.monotonic() < end:
            pictures.try_recv()
        time.sleep(0.2)
        imu.undeclare()
        pictures.undeclare()
        return before, len(samples)


queue, ring = received(), received(zenoh.handlers.RingChannel(4))
print(f"zenoh 1.10.2: IMU samples of 1000 before the pictures are read, and after: queue {queue}, ring {ring}")
sys.exit(0 if queue[0] < 900 and queue[1] == 1000 and ring[0] == 1000 else 1)
CODE
