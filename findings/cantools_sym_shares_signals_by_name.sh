#!/bin/sh
# cantools 45.1.0: a database that is written as SYM (`as_sym_string`, `cantools convert in.dbc out.sym`) has one definition for each signal name. Two messages with a signal of the same name, as
# "Velocity" of two kinds of drives, may have other scales, lengths or signs in DBC; in the SYM file both have those of the first, and nothing is said.
# KCD and DBC keep them apart.
# Seen: "Velocity" of 0.01 rad/s per count, and of 0.5 in the second message: the second reads a frame of 2.0 rad/s as 0.04 rad/s after the way through SYM.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check cantools==45.1.0
"$folder/env/bin/python" - <<'CODE'
import sys

import cantools

TEXT = """VERSION ""
NS_ :
BS_:
BU_: Host
BO_ 256 Knee: 8 Host
 SG_ Velocity : 0|16@1- (0.01,0) [0|0] "rad/s" Host
BO_ 257 Wheel: 8 Host
 SG_ Velocity : 0|16@1- (0.5,0) [0|0] "rad/s" Host
"""
first = cantools.database.load_string(TEXT, "dbc")
frame = first.get_message_by_name("Wheel").encode({"Velocity": 2.0})
found = {"as given": first.decode_message(257, frame)["Velocity"]}
for kind in ("dbc", "kcd", "sym"):
    again = cantools.database.load_string(getattr(first, f"as_{kind}_string")(), kind)
    found[kind] = again.decode_message(257, frame)["Velocity"]
print("a frame of the wheel: " + "; ".join(f"{kind} {value:g} rad/s" for kind, value in found.items()))
sys.exit(0 if found["as given"] == found["dbc"] == found["kcd"] == 2.0 and abs(found["sym"] - 0.04) < 1e-9 else 1)
CODE
