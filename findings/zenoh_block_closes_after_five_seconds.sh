#!/bin/sh
# eclipse-zenoh 1.10.2: a publisher with Reliability.RELIABLE and CongestionControl.BLOCK does not wait until there is room. After 5 s in one
# `put` it closes the connection, whatever the lease (here 60 s), and says so nowhere: that `put` and all later ones return as if they had been
# sent, and the messages are lost. So a slow or standing reader loses its session, and "reliable, blocking" is no promise of delivery.
# The setting is transport/link/tx/queue/congestion_control/block/wait_before_close [us]; with 20 s the same run loses nothing.
# Seen: a subscriber stands still for 8 s while 512-byte messages are put; the longest put takes 5.0 s and tens of thousands of messages never
# come; with 20 s none is missing. Exits non-zero if the longest put is not 5 s, or if nothing is lost.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install eclipse-zenoh==1.10.2
cat > "$folder/session.py" <<'P'
import json, socket, zenoh

def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]

def session(listen=(), connect=(), **more):
    settings = {"mode": "peer", "scouting/multicast/enabled": False, "listen/endpoints": list(listen),
                "connect/endpoints": list(connect), "transport/link/tx/lease": 60000, **more}
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)
P
cat > "$folder/subscriber.py" <<'P'
import sys, time, zenoh
from session import session

seen = set()
with session(listen=[f"tcp/127.0.0.1:{sys.argv[1]}"]) as s:
    take = zenoh.handlers.Callback(lambda x: seen.add(int(x.payload.to_bytes()[:12])), indirect=False)
    s.declare_subscriber("numbers", take)
    print("ready", flush=True)
    sys.stdin.readline()
    time.sleep(2.0)
    print(len(seen), flush=True)
P
cd "$folder"
"$folder/venv/bin/python" - <<'P'
import os, signal, subprocess, sys, threading, time, zenoh
from session import free_port, session


def longest_put_and_lost(**more):
    port = free_port()
    other = subprocess.Popen([sys.executable, "subscriber.py", str(port)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    other.stdout.readline()
    with session(connect=[f"tcp/127.0.0.1:{port}"], **more) as s:
        publisher = s.declare_publisher("numbers", congestion_control=zenoh.CongestionControl.BLOCK, reliability=zenoh.Reliability.RELIABLE)
        time.sleep(1.0)
        os.kill(other.pid, signal.SIGSTOP)
        threading.Timer(8.0, os.kill, (other.pid, signal.SIGCONT)).start()
        longest = 0.0
        for number in range(50_000):
            since = time.monotonic()
            publisher.put(b"%012d" % number + bytes(500))
            longest = max(longest, time.monotonic() - since)
        time.sleep(4.0)
        print("", file=other.stdin, flush=True)
        came = int(other.stdout.readline())
    other.wait(20)
    return longest, number + 1 - came


default = longest_put_and_lost()
patient = longest_put_and_lost(**{"transport/link/tx/queue/congestion_control/block/wait_before_close": 20_000_000})
print("default:  longest put %.1f s, %d of 50000 messages lost, no exception" % default)
print("20 s:     longest put %.1f s, %d of 50000 messages lost" % patient)
raise SystemExit(0 if 4.5 < default[0] < 6.0 and default[1] > 0 and patient[1] == 0 else 1)
P
