#!/bin/sh
# moteus 1.1.1: with a position resolution of INT16 a command to 5 turns is sent as 3.2767 turns, and one to -7 as -3.2767:
# the library saturates what does not fit, without an exception or a warning, and the frame asks for another place. A joint behind a gear leaves that range at once where positions
# count rotor turns. Torques (327.67 N m) are treated likewise.
# Seen: the bytes of the frames for 5.0 and 3.2767 turns are within one count, 0x7fff; with F32 they differ. Exits non-zero if 5 turns are refused or sent as such.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install moteus==1.1.1
"$folder/venv/bin/python" - <<'P'
import struct
import moteus

resolution = moteus.PositionResolution()
resolution.position = resolution.velocity = moteus.INT16
short = moteus.Controller(id=1, position_resolution=resolution)
full = moteus.Controller(id=1)


def sent(position):
    """The position in the frame [turns]: 01 00 0a is the mode, then the head of the registers from 0x20 on."""
    data = bytes(short.make_position(position=position, velocity=0.0).data)
    at = data.index(b"\x20", 3) + 1
    return struct.unpack_from("<h", data, at)[0] * 1e-4


for wanted in (3.0, 5.0, -7.0):
    print(f"commanded {wanted:+.4f} turns, sent {sent(wanted):+.4f}")
differ = bytes(full.make_position(position=5.0).data) != bytes(full.make_position(position=3.2767).data)
print("with F32 5.0 and 3.2767 turns are", "different frames" if differ else "the same frame")
raise SystemExit(0 if abs(sent(3.0) - 3.0) < 1e-3 and abs(sent(5.0) - 3.2767) < 1e-3 and abs(sent(-7.0) + 3.2767) < 1e-3 and differ else 1)
P
