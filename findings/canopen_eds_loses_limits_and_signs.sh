#!/bin/sh
# canopen 2.4.1: of an EDS file it reads hexadecimal limits of signed objects in two's complement, and their DefaultValue and ParameterValue not: 0xFFFFFFCE, which is -50 in an INTEGER32, becomes
# 4294967246. Limits of REAL32 and REAL64 objects are read as integers, and where that fails they are left out: "LowLimit=-0.5" is no limit. Nothing is said while
# the file is read. Who writes a drive's defaults, or clamps to its limits, by the dictionary has neither.
# Seen: default 4294967246 with limits -2147483648 and 2147483647; limits None for a gain of -0.5 to 2.5, -1 and 2 where they are written without a point.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check canopen==2.4.1 python-can==4.6.1
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import canopen

OBJECT = "[{}]\nParameterName={}\nObjectType=0x7\nDataType={}\nAccessType=rw\nDefaultValue={}\nLowLimit={}\nHighLimit={}\nPDOMapping=0\n"
with open("drive.eds", "w") as file:
    file.write("[DeviceInfo]\nVendorName=none\n")
    file.write(OBJECT.format("607C", "Home offset", "0x0004", "0xFFFFFFCE", "0x80000000", "0x7FFFFFFF"))
    file.write(OBJECT.format("2000", "Gain", "0x0008", "1.5", "-0.5", "2.5"))
    file.write(OBJECT.format("2001", "Whole gain", "0x0008", "1.5", "-1", "2"))
dictionary = canopen.import_od("drive.eds", node_id=1)
found = {entry.name: (entry.default, entry.min, entry.max) for entry in dictionary.values()}
for name, (default, low, high) in sorted(found.items()):
    print(f"{name}: default {default}, limits {low} and {high}")
right = {"Home offset": (4294967246, -(2**31), 2**31 - 1), "Gain": (1.5, None, None), "Whole gain": (1.5, -1, 2)}
sys.exit(0 if found == right else 1)
CODE
