#!/bin/sh
# rosbags 0.11.9: an array field of a message is written with the bytes of the array it is given, if the items have the width of the field's. `np.array([0, 1, -1])` for the float64[] `position` of a JointState is
# int64: its bits are written as floats, and 1 becomes 5e-324, -1 becomes NaN. Arrays of the other byte order are swapped twice. float32 and int32 arrays of it are refused.
# Expected: whole numbers are converted, as mcap-ros2-support converts those of a list, or refused like all other wrong types. Seen: serialize_cdr says nothing, the bag is valid, and a
# log of angles in whole degrees or encoder counts holds zeros, or nearly.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import io
import sys

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
Header, Time, JointState = (store.types[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/JointState"))
none = np.zeros(0)


def read_back(position):
    message = JointState(Header(Time(0, 0), ""), ["hip", "knee", "foot"], position, none, none)
    try:
        return store.deserialize_cdr(store.serialize_cdr(message, JointState.__msgtype__), JointState.__msgtype__).position
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def mcap_read_back(position):
    file = io.BytesIO()
    writer = Writer(file)
    schema = writer.register_msgdef("arm_msgs/msg/Joints", "float64[] position\n")
    writer.write_message("/joints", schema, {"position": position.tolist()})
    writer.finish()
    file.seek(0)
    return list(next(iter(read_ros2_messages(file))).ros_msg.position)


whole = np.array([0, 1, -1])
right = read_back(whole.astype(float))
rows = {"int64": read_back(whole), "big-endian float64": read_back(whole.astype(">f8")), "float32": read_back(whole.astype(np.float32))}
for name, row in rows.items():
    print(f"rosbags 0.11.9: position {whole} as {name} is read as {row}")
other = mcap_read_back(whole)
print(f"mcap-ros2-support 0.6.0: whole numbers are read as {other}")
wrong = rows["int64"][0] == 0.0 and rows["int64"][1] == 5e-324 and np.isnan(rows["int64"][2]) and abs(rows["big-endian float64"][1]) < 1e-300
sys.exit(0 if wrong and list(right) == other == [0.0, 1.0, -1.0] and "Error" in rows["float32"] else 1)
CODE
