#!/bin/sh
# Pinocchio 4.1.0 (pin) reads the upper-case letters of MJCF's `eulerseq`, turns about fixed axes, as the lower-case ones, turns about axes
# that move along: euler="90 90 0" with eulerseq="XYZ", the order of ROS and URDF, is another attitude. MuJoCo 4.0.1 and Drake 1.51.1
# agree with each other.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6 drake==1.51.1
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

TEXT = """<mujoco model="m"><compiler eulerseq="{}"/><worldbody><body name="arm" euler="90 90 0"><joint name="elbow" axis="0 1 0"/>
  <geom size=".1" pos="0 0 -1"/></body></worldbody></mujoco>"""


def places(order):
    """The CoM [m] in MuJoCo, Pinocchio and Drake."""
    with open("m.xml", "w") as file:
        file.write(TEXT.format(order))
    model, other, plant = mujoco.MjModel.from_xml_path("m.xml"), pin.buildModelFromMJCF("m.xml"), MultibodyPlant(0.0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    Parser(plant).AddModels("m.xml")
    plant.Finalize()
    found = (
        data.subtree_com[1], pin.centerOfMass(other, other.createData(), pin.neutral(other)),
        plant.CalcCenterOfMassPositionInWorld(plant.CreateDefaultContext()),
    )
    print(order, *(f"{name} {np.round(com, 3) + 0.0}" for name, com in zip(("MuJoCo", "Pinocchio", "Drake"), found)))
    return found


within, fixed = places("xyz"), places("XYZ")
so = np.allclose(within[0], within[1]) and np.allclose(fixed[0], fixed[2]) and np.linalg.norm(fixed[0] - fixed[1]) > 1.0
sys.exit(0 if so else 1)
CODE
