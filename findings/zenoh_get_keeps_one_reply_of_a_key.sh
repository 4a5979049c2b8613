#!/bin/sh
# eclipse-zenoh 1.10.2: `session.get` of one key gives one reply. A queryable that answers with five samples of a log, all under the key that was
# asked for, is heard with its last one: the consolidation that is chosen by itself keeps the newest of each key, here at the asking side.
# Only a selector with a `_time` parameter, or consolidation=zenoh.ConsolidationMode.NONE, gives all. Who fetches the history of a joint gets its last sample.
# Seen: five replies under "robot/log": 1 for "robot/log" and for "robot/*", 5 with NONE and for "robot/log?_time=[now(-1h)..]".
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "eclipse-zenoh==1.10.2"
timeout 60 "$folder/venv/bin/python" - <<'CODE'
import json
import socket
import sys
import time

import zenoh

with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    address = f"tcp/127.0.0.1:{free.getsockname()[1]}"


def session(role):
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    for each in ("listen", "connect"):
        config.insert_json5(f"{each}/endpoints", json.dumps([address] if each == role else []))
    return zenoh.open(config)


def answer(query):
    for number in range(5):
        query.reply("robot/log", str(number))


robot, reader = session("listen"), session("connect")
queryable = robot.declare_queryable("robot/log", answer)
until = time.monotonic() + 10
while not list(reader.get("robot/log")) and time.monotonic() < until:
    time.sleep(0.05)
asked = {
    "robot/log": reader.get("robot/log"),
    "robot/*": reader.get("robot/*"),
    "robot/log, NONE": reader.get("robot/log", consolidation=zenoh.ConsolidationMode.NONE),
    "robot/log?_time=[now(-1h)..]": reader.get("robot/log?_time=[now(-1h)..]"),
}
got = [[reply.ok.payload.to_string() for reply in replies] for replies in asked.values()]
for name, samples in zip(asked, got):
    print(f"eclipse-zenoh 1.10.2: {name}: {len(samples)} of 5 replies: {samples}")
queryable.undeclare()
reader.close()
robot.close()
sys.exit(0 if got[0] == got[1] == ["4"] and got[2] == got[3] == ["0", "1", "2", "3", "4"] else 1)
CODE
