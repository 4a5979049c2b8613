#!/bin/sh
# roboticstoolbox-python 1.5.0: a URDF joint whose axis is not one of x, y and z is read wrong. The axis is taken for a rotation vector: the link is turned by it, 57.3 deg
# already at zero, and then moves about or along the z axis of what results. Hips of humanoids and shoulders of arms have such axes; axes along x, y and z, also negative ones,
# are right, so most robots are. Pinocchio 4.1.0 (pin) and MuJoCo 4.0.1 agree with each other and with the format. Nothing is said.
# Seen: axis "0.6 0.8 0", joint at zero: the link is turned by 57.3 deg, in the others by 0; at 0.5 rad it has turned about (0.67, -0.50, 0.54).
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check roboticstoolbox-python==1.5.0 pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6 scipy==1.17.1
cd "$folder"
MPLCONFIGDIR="$folder" "$folder/env/bin/python" -W ignore - <<'CODE'
import os
import sys

import mujoco
import numpy as np
import pinocchio
import roboticstoolbox
from scipy.spatial.transform import Rotation

TEXT = """<robot name="arm"><mujoco><compiler fusestatic="false"/></mujoco><link name="base"/>
<link name="tip"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="{}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def turned(text, angle):
    """The rotation vectors of the tip [rad] by the toolbox, Pinocchio and MuJoCo."""
    with open("arm.urdf", "w") as file:
        file.write(text)
    toolbox = roboticstoolbox.ERobot.URDF(os.path.abspath("arm.urdf")).fkine([angle]).R
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.array([angle]))
    other = mujoco.MjModel.from_xml_string(text)
    state = mujoco.MjData(other)
    state.qpos[0] = angle
    mujoco.mj_kinematics(other, state)
    all_three = toolbox, data.oMf[model.getFrameId("tip")].rotation, state.body("tip").xmat.reshape(3, 3)
    return [Rotation.from_matrix(matrix).as_rotvec() for matrix in all_three]


found = {}
for axis in ("0 0 -1", "0.6 0.8 0"):
    for angle in (0.0, 0.5):
        found[axis, angle] = turned(TEXT.format(axis), angle)
        print(f"axis {axis} at {angle} rad: " + "; ".join(f"{name} {np.round(v, 3) + 0.0}" for name, v in zip(("toolbox", "Pinocchio", "MuJoCo"), found[axis, angle])))
vectors = lambda axis, angle: angle * np.array(axis.split(), float)
right = all(np.allclose(v, vectors(*key), atol=1e-6) for key, value in found.items() for v in value[1:])
plain = all(np.allclose(found["0 0 -1", angle][0], (0, 0, -angle), atol=1e-6) for angle in (0.0, 0.5))
sys.exit(0 if right and plain and np.allclose(found["0.6 0.8 0", 0.0][0], (0.6, 0.8, 0.0), atol=1e-6) else 1)
CODE
