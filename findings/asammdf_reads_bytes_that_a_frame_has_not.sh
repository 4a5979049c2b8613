#!/bin/sh
# asammdf 8.8.28: `extract_bus_logging` decodes CAN frames of a log by a DBC. A frame that is shorter than its message, as devices send that leave optional fields out, has in MDF 4 its length beside a field of bytes that is padded.
# The length is not looked at: signals beyond the end of the frame are read from the padding, as zeros, and are valid samples.
# Expected: no sample of a signal that the frame does not have, or an invalid one. Seen: "current" of 9 A, in every second frame, is 9, 0, 9, 0 A; its mean is half. cantools 45.1.0, which asammdf's users know for the same DBC,
# refuses such a frame, or leaves the signal out (allow_truncated=True). Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check asammdf==8.8.28 python-can==4.6.1 cantools==45.1.0 canmatrix==1.2 numpy==2.4.6 pandas==3.1.1
cd "$folder"
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import can  # before asammdf, or its MF4 writer is missing
import cantools
from asammdf import MDF

DRIVE = """VERSION ""
BU_: drive
BO_ 500 Status: 8 drive
 SG_ speed : 0|16@1- (1,0) [0|0] "rpm" drive
 SG_ current : 32|16@1- (1,0) [0|0] "A" drive
"""
with open("drive.dbc", "w") as file:
    file.write(DRIVE)
whole, short = bytes([7, 0, 0, 0, 9, 0, 0, 0]), bytes([7, 0])
frames = [can.Message(timestamp=1.76e9 + 0.01 * k, arbitration_id=500, is_extended_id=False, data=short if k % 2 else whole) for k in range(6)]
with can.Logger("log.mf4") as log:
    for frame in frames:
        log.on_message_received(frame)
with can.LogReader("log.mf4") as log:
    lengths = [frame.dlc for frame in log]
with MDF("log.mf4") as log:
    decoded = log.extract_bus_logging(database_files={"CAN": [("drive.dbc", 0)]})
    found = {name: decoded.get(name).samples.tolist() for name in ("speed", "current")}
status = cantools.database.load_file("drive.dbc").get_message_by_name("Status")
other = [dict(status.decode(bytes(frame.data), allow_truncated=True)).get("current") for frame in frames]
try:
    status.decode(short)
    refused = False
except cantools.database.DecodeError:
    refused = True
print(f"frames of {lengths} bytes; asammdf 8.8.28: {found}; cantools 45.1.0: current {other}, short frames refused by default: {refused}")
right = lengths == [8, 2] * 3 and found == {"speed": [7] * 6, "current": [9, 0] * 3}
sys.exit(0 if right and refused and other == [9, None] * 3 else 1)
CODE
