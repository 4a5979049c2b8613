#!/bin/sh
# eclipse-zenoh 1.10.2: `put` of a publisher with CongestionControl.DROP waits. A message that needs more than one batch (64 KiB) is cut into fragments, and for these
# it waits for room for up to 50 ms before it drops them: a control loop at 500 Hz that sends a camera image or a map to a reader that stands still misses ten or more ticks
# though it asked to drop. The setting is transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments [us].
# Seen: with a subscriber that stands still the longest of 40 puts of 1 MB takes 30 to 50 ms, and 2 to 4 ms with that setting at 1000. Exits non-zero if the default is not more than
# three times as long.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install eclipse-zenoh==1.10.2
cat > "$folder/peer.py" <<'P'
import json, sys, time, zenoh

def session(listen=(), connect=(), **more):
    settings = {"mode": "peer", "scouting/multicast/enabled": False, "listen/endpoints": list(listen),
                "connect/endpoints": list(connect), "transport/link/tx/lease": 60000, **more}
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)

if __name__ == "__main__":
    with session(listen=[f"tcp/127.0.0.1:{sys.argv[1]}"]) as s:
        subscriber = s.declare_subscriber("image", zenoh.handlers.RingChannel(1))
        print("ready", flush=True)
        time.sleep(60)
P
cd "$folder"
"$folder/venv/bin/python" - <<'P'
import os, signal, socket, subprocess, sys, time, zenoh
from peer import session


def longest_put(**more):
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    other = subprocess.Popen([sys.executable, "peer.py", str(port)], stdout=subprocess.PIPE, text=True)
    other.stdout.readline()
    times = []
    with session(connect=[f"tcp/127.0.0.1:{port}"], **more) as s:
        publisher = s.declare_publisher("image", congestion_control=zenoh.CongestionControl.DROP)
        time.sleep(1.0)
        os.kill(other.pid, signal.SIGSTOP)
        for _ in range(40):
            since = time.perf_counter()
            publisher.put(bytes(1_000_000))
            times.append(time.perf_counter() - since)
        other.kill()
        other.wait()
    return 1e3 * sorted(times)[-1]


setting = "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments"
default = max(longest_put() for _ in range(3))
short = min(longest_put(**{setting: 1000}) for _ in range(3))
print(f"longest put of 1 MB with CongestionControl.DROP: {default:.1f} ms by default, {short:.1f} ms with {setting}=1000")
raise SystemExit(0 if default > 3.0 * short and default > 15.0 else 1)
P
