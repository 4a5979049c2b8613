#!/bin/sh
# ROS 2's `byte` is an octet and its `char` an unsigned char, both 0 to 255. rosbags 0.11.9 reads `byte` as signed, mcap-ros2-support 0.6.0 `char`: each is wrong in the other's right one, so the same bytes of a message are
# four different numbers by two readers. Values from 128 on, as of status bytes, masks of flags and raw samples, are negative; below nothing shows it.
# Expected: 200 for both types by both readers. Seen: byte -56 by rosbags, 200 by mcap; char 200 by rosbags, -56 by mcap. rosbags itself declares `byte[]` as an array of uint8, and gives int8; and
# what it is given to write above 127 in a `byte` it refuses, as mcap refuses a `char` of 200.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

DEFINITION = "byte one_byte\nchar one_char\nuint8 one_uint8\nint8 one_int8\nbyte[3] bytes\nchar[3] chars\nuint8[3] uint8s\n"
NAME = "drive_msgs/msg/Status"
message = bytes([0, 1, 0, 0]) + bytes([200] * 4) + bytes([127, 128, 255] * 3)  # little-endian CDR; single bytes have no padding

store = get_typestore(Stores.ROS2_JAZZY)
store.register(get_types_from_msg(DEFINITION, NAME))
by_rosbags = store.deserialize_cdr(message, NAME)
schema = Schema(id=1, name=NAME, encoding="ros2msg", data=DEFINITION.encode())
by_mcap = DecoderFactory().decoder_for("cdr", schema)(message)
fields = [line.split()[1] for line in DEFINITION.splitlines()]


def number(message, field):
    value = getattr(message, field)
    return value if isinstance(value, int) else [int(each) for each in value]


found = {field: (number(by_rosbags, field), number(by_mcap, field)) for field in fields}
for field, (one, other) in found.items():
    print(f"{field}: {one} by rosbags 0.11.9, {other} by mcap-ros2-support 0.6.0")
signed, unsigned = [127, -128, -1], [127, 128, 255]
wanted = {
    "one_byte": (-56, 200),
    "one_char": (200, -56),
    "one_uint8": (200, 200),
    "one_int8": (-56, -56),
    "bytes": (signed, unsigned),
    "chars": (unsigned, signed),
    "uint8s": (unsigned, unsigned),
}
sys.exit(0 if found == wanted else 1)
CODE
