#!/bin/sh
# urchin 0.0.30 (the successor of urdfpy): a link of a URDF without <inertial>, as tool frames and camera frames are, gets 1 kg and 1 kg m^2, and `save`
# writes them into the file. To load and save a robot, to change a path or a limit, makes it heavier by a kilogram for each of its frames in every other reader.
# yourdfpy 0.0.60 writes what it has read.
# Seen: an arm of 2 kg with two frames: 2 kg before, 4 kg after urchin, 2 kg after yourdfpy, weighed by Pinocchio 4.1.0 (pin).
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "urchin==0.0.30" "yourdfpy==0.0.60" "pin==4.1.0" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'CODE'
import sys

import pinocchio as pin
import urchin
import yourdfpy

FIXED = '<joint name="{0}" type="fixed"><parent link="arm"/><child link="{0}"/><origin xyz="0.5 0 0"/></joint>'
with open("arm.urdf", "w") as file:
    file.write(
        '<robot name="arm"><link name="world"/><link name="arm"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
        'ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tool0"/><link name="camera_frame"/><joint name="hinge" type="revolute">'
        '<parent link="world"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint>'
        + FIXED.format("tool0") + FIXED.format("camera_frame") + "</robot>"
    )
urchin.URDF.load("arm.urdf").save("by_urchin.urdf")
yourdfpy.URDF.load("arm.urdf", load_meshes=False).write_xml_file("by_yourdfpy.urdf")
masses = {name: pin.buildModelFromUrdf(f"{name}.urdf").inertias[1].mass for name in ("arm", "by_urchin", "by_yourdfpy")}
print("urchin 0.0.30: mass of the moving part: " + ", ".join(f"{name} {mass:g} kg" for name, mass in masses.items()))
sys.exit(0 if masses == {"arm": 2.0, "by_urchin": 4.0, "by_yourdfpy": 2.0} else 1)
CODE
