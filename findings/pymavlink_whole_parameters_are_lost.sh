#!/bin/sh
# pymavlink 2.4.50: PX4 sends whole parameters (INT32) as the bits of the float that a PARAM_VALUE has, and says so in `param_type`. pymavlink keeps the float: `param_value` of SYS_AUTOSTART = 4001 is 5.6e-42, so it is in
# the connection's `params`, and `MAVParmDict.save` writes "0.000000" of it: every whole parameter of the saved file is 0 (those below zero are nan), and `load` has zeros.
# Expected: 4001, as the type in the same message says, and as `mavset` of the same module does for sending if it is given the type. Seen: 4001 -> 0, -1 -> nan, 1 -> 0; floats are right.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pymavlink==2.4.50
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import socket
import struct
import sys

from pymavlink import mavparm, mavutil

SENT = {"SYS_AUTOSTART": 4001, "COM_FLTMODE1": -1, "CBRK_USB_CHK": 1, "MC_ROLLRATE_P": 0.15}  # as PX4 has them
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
vehicle = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=1, source_component=1)
link = mavutil.mavlink
vehicle.mav.heartbeat_send(link.MAV_TYPE_QUADROTOR, link.MAV_AUTOPILOT_PX4, 0, 0, 0)
station.recv_match(type="HEARTBEAT", blocking=True, timeout=5)
station.target_system, station.target_component = 1, 1
known = mavparm.MAVParmDict()
for index, (name, value) in enumerate(SENT.items()):
    whole = isinstance(value, int)
    bits = struct.unpack("<f", struct.pack("<i", value))[0] if whole else value
    kind = link.MAV_PARAM_TYPE_INT32 if whole else link.MAV_PARAM_TYPE_REAL32
    vehicle.mav.param_value_send(name.encode(), bits, kind, len(SENT), index)
    message = station.recv_match(type="PARAM_VALUE", blocking=True, timeout=5)
    known[message.param_id] = message.param_value
    print(f"pymavlink 2.4.50: {name} {value} is param_value {message.param_value}, type {message.param_type}; params {station.param(name)}")
known.save("px4.parm")
again = mavparm.MAVParmDict()
again.load("px4.parm")
print("saved and loaded:", {name: again[name] for name in SENT})
right = again["SYS_AUTOSTART"] == again["CBRK_USB_CHK"] == 0.0 and again["COM_FLTMODE1"] != again["COM_FLTMODE1"]
sys.exit(0 if right and abs(again["MC_ROLLRATE_P"] - 0.15) < 1e-6 and station.param("SYS_AUTOSTART") < 1e-40 else 1)
CODE
