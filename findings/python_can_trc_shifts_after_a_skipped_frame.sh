#!/bin/sh
# python-can 4.6.1: a TRC log that begins with a frame its writer skips (CAN FD, remote or error frames: told as a warning) has
# wrong stamps for all that follow. The start of the log is the first frame that was written, its offset is counted from the
# first that was seen, so the time between the two is added twice when it is read. A log whose first frame is classic is right.
# Seen: an FD frame at 100 s, classic frames at 103 and 104 s: read at 106 and 107 s.
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


def read_back(*frames):
    with can.Logger("frames.trc") as log:
        for frame in frames:
            log.on_message_received(frame)
    with can.LogReader("frames.trc") as log:
        return [round(frame.timestamp, 3) for frame in log]


fd = can.Message(timestamp=100.0, arbitration_id=1, is_fd=True, data=bytes(12))
classic = [can.Message(timestamp=t, arbitration_id=2, is_extended_id=False, data=b"\1\2") for t in (103.0, 104.0)]
late, right = read_back(fd, *classic), read_back(*classic)
print(f"python-can {can.__version__}: frames at 103 and 104 s are read at {late} after a skipped frame at 100 s, at {right} without it")
sys.exit(0 if late == [106.0, 107.0] and right == [103.0, 104.0] else 1)
CODE
