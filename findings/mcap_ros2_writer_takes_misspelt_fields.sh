#!/bin/sh
# mcap-ros2-support 0.6.0: its writer takes any dictionary for a message. A misspelt field is left out and the true one is written as zero (or
# as the default of the definition), a fixed array that is too short is filled with zeros and one that is too long is cut, None is a zero.
# Nothing is raised, and the file is valid. A command that was logged so replays as "go to zero". rosbags 0.11.9 raises for
# the short and the long array and has no fields to misspell.
# The caller's own list is lengthened by None, too.
# Seen: {"positon": 1.5} is read back as position 0.0, [1, 2] of a float64[3] as [1, 2, 0], [1, 2, 3, 4] as [1, 2, 3].
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "mcap-ros2-support==0.6.0" "mcap==1.6.0" "rosbags==0.11.9" "numpy==2.4.6"
"$folder/venv/bin/python" -W ignore - <<'CODE'
import io
import sys

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

DEFINITION = "float64 position\nfloat64[3] gains\n"
given = [{"position": 1.5}, {"positon": 1.5}, {"position": None}, {"gains": [1, 2]}, {"gains": [1, 2, 3, 4]}]
file = io.BytesIO()
writer = Writer(file)
schema = writer.register_msgdef("arm_msgs/msg/Command", DEFINITION)
for time, message in enumerate(given):
    writer.write_message("/command", schema, message, log_time=time)
writer.finish()
file.seek(0)
read = [(each.ros_msg.position, list(each.ros_msg.gains)) for each in read_ros2_messages(file)]
for message, back in zip(given, read):
    print(f"mcap-ros2-support 0.6.0: {message} is read as position {back[0]}, gains {back[1]}")

store = get_typestore(Stores.ROS2_HUMBLE)
store.register(get_types_from_msg(DEFINITION, "arm_msgs/msg/Command"))
command, refused = store.types["arm_msgs/msg/Command"], 0
for gains in ([1.0, 2.0], [1.0, 2.0, 3.0, 4.0]):
    try:
        store.serialize_cdr(command(1.5, np.array(gains)), "arm_msgs/msg/Command")
    except Exception as error:
        refused += 1
        print(f"rosbags 0.11.9: {gains}: {type(error).__name__}: {error}")
zeros = [0.0, 0.0, 0.0]
wanted = [(1.5, zeros), (0.0, zeros), (0.0, zeros), (0.0, [1.0, 2.0, 0.0]), (0.0, [1.0, 2.0, 3.0])]
sys.exit(0 if read == wanted and refused == 2 else 1)
CODE
