#!/bin/sh
# eclipse-zenoh 1.10.2: after how long a session takes a silent peer for lost is not set by its own `transport/link/tx/lease` but by that of the peer: each
# end tells the other how long to bear its silence. A watcher with a lease of 1 s notices a frozen peer with the default (10 s) after 9 s, and the other
# way round after 1 s. So a short lease on the safety-critical side alone does nothing; it must be set on whatever may freeze.
# Seen: noticed after 3.0 s and 0.9 s for leases of 4 s and 1 s (frozen, watching) and the reverse. Exits non-zero if the watcher's own lease decides.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install eclipse-zenoh==1.10.2
cat > "$folder/peer.py" <<'P'
import json, sys, time, zenoh

def session(lease, listen=(), connect=()):
    settings = {"mode": "peer", "scouting/multicast/enabled": False, "listen/endpoints": list(listen),
                "connect/endpoints": list(connect), "transport/link/tx/lease": lease}
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)

if __name__ == "__main__":
    with session(int(sys.argv[1]), listen=[f"tcp/127.0.0.1:{sys.argv[2]}"]) as s:
        token = s.liveliness().declare_token("alive")
        print("ready", flush=True)
        time.sleep(60)
P
cd "$folder"
"$folder/venv/bin/python" - <<'P'
import os, signal, socket, subprocess, sys, time, zenoh
from peer import session


def noticed_after(frozen, watching):
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    other = subprocess.Popen([sys.executable, "peer.py", str(frozen), str(port)], stdout=subprocess.PIPE, text=True)
    other.stdout.readline()
    seen = []
    with session(watching, connect=[f"tcp/127.0.0.1:{port}"]) as s:
        take = zenoh.handlers.Callback(lambda x: seen.append(time.monotonic()), indirect=False)
        subscriber = s.liveliness().declare_subscriber("alive", take, history=True)
        end = time.monotonic() + 20.0
        while not seen and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(1.0)
        since = time.monotonic()
        os.kill(other.pid, signal.SIGSTOP)
        while len(seen) < 2 and time.monotonic() < since + 15.0:
            time.sleep(0.01)
        other.kill()
        other.wait()
    return seen[1] - since


long, short = noticed_after(4000, 1000), noticed_after(1000, 4000)
print(f"the frozen peer's lease 4 s, the watcher's 1 s: noticed after {long:.1f} s")
print(f"the frozen peer's lease 1 s, the watcher's 4 s: noticed after {short:.1f} s")
raise SystemExit(0 if long > 2.0 > short else 1)
P
