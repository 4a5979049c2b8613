#!/bin/sh
# Pinocchio 4.1.0 (pin): computeKineticEnergy counts `model.armature` for hinges about x, y and z, and leaves it out for hinges about any
# other axis; a URDF's axis "0 0 -1" makes such a one. The mass matrix, rnea and aba count it for all. So an energy balance, an
# observer or a passivity check is wrong in some joints of an arm and right in others, by as much as the rotors weigh.
# Seen: one hinge with armature 0.1 kg m^2 at 2 rad/s: axis "0 0 1" has v M v / 2, axis "0 0 -1" 0.2 J less; computeMechanicalEnergy likewise.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'CODE'
import sys

import numpy as np
import pinocchio as pin

URDF = """<robot name="hinge"><link name="world"/><link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="hinge" type="revolute">
<parent link="world"/><child link="arm"/><axis xyz="{}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
missing, speed = {}, np.array([2.0])
for axis in ("1 0 0", "0 1 0", "0 0 1", "0 0 -1", "0 0.6 0.8"):
    model = pin.buildModelFromXML(URDF.format(axis))
    model.armature = np.array([0.1])
    data, q = model.createData(), pin.neutral(model)
    by_mass = 0.5 * speed @ pin.crba(model, model.createData(), q) @ speed
    kinetic, potential = pin.computeKineticEnergy(model, data, q, speed), pin.computePotentialEnergy(model, data, q)
    mechanical = pin.computeMechanicalEnergy(model, data, q, speed) - potential
    missing[axis] = (round(by_mass - kinetic, 9), round(by_mass - mechanical, 9))
    print(f"pin 4.1.0: axis {axis} ({model.joints[1].shortname()}): v M v / 2 {by_mass:.4f} J, computeKineticEnergy {kinetic:.4f} J")
right = [missing[axis] for axis in ("1 0 0", "0 1 0", "0 0 1")]
sys.exit(0 if right == [(0, 0)] * 3 and missing["0 0 -1"] == missing["0 0.6 0.8"] == (0.2, 0.2) else 1)
CODE
