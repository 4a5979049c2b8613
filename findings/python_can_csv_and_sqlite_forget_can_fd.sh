#!/bin/sh
# python-can 4.6.1: its CSV and SQLite logs keep no mark of CAN FD, of the bit rate switch or of the channel. A frame of 12 to
# 64 bytes, as moteus and other drives send, comes back as a classic frame of 12 to 64 bytes, which python-can's own check
# refuses ("<= 8 for normal CAN frames"): a replay sends other frames than were logged, or none. BLF, ASC and candump logs keep
# the marks. Neither writer says that it leaves something out.
# Seen: is_fd, bitrate_switch and channel of four FD frames lost by .csv and .db, none by .blf.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "python-can==4.6.1"
cd "$folder"
"$folder/venv/bin/python" - <<'CODE'
import sys

import can

sent = [
    can.Message(timestamp=1.0 + n / 1000, arbitration_id=n, is_fd=True, bitrate_switch=True, data=bytes(n), channel=1, check=True)
    for n in (8, 12, 20, 64)
]


def read_back(kind):
    with can.Logger(f"frames.{kind}") as log:
        for frame in sent:
            log.on_message_received(frame)
    with can.LogReader(f"frames.{kind}") as log:
        return [(bool(f.is_fd), bool(f.bitrate_switch), f.channel, f.dlc) for f in log]


rows = {kind: read_back(kind) for kind in ("blf", "csv", "db")}
for kind, row in rows.items():
    print(f"python-can {can.__version__}: {kind}: (FD, rate switch, channel, bytes) {row}")
try:
    can.Message(arbitration_id=1, data=bytes(12), check=True)
    refused = ""
except ValueError as error:
    refused = str(error)
print("a classic frame of 12 bytes:", refused)
lost = [(False, False, None, n) for n in (8, 12, 20, 64)]
kept = [(True, True, 1, n) for n in (8, 12, 20, 64)]
sys.exit(0 if rows["csv"] == rows["db"] == lost and rows["blf"] == kept and refused else 1)
CODE
