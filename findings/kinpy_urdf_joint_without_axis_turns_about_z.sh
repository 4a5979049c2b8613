#!/bin/sh
# A URDF joint without <axis> turns about x: the format's default is (1, 0, 0), as MuJoCo 4.0.1, Pinocchio 4.1.0 (pin) and ikpy 4.2.1 read it. kinpy 0.6.1 turns, and slides, it along z,
# and gives Jacobians for that axis, without a word. Files that were written by hand or by scripts leave the axis out where it is x.
# Seen: a joint at 0.5 rad: kinpy (0, 0, 0.5), the others (0.5, 0, 0). Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check kinpy==0.6.1 ikpy==4.2.1 pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6 scipy==1.17.1
cd "$folder"
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import ikpy.chain
import kinpy
import mujoco
import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

TEXT = """<robot name="arm"><mujoco><compiler fusestatic="false"/></mujoco><link name="base"/>
<link name="tip"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="tip"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""
with open("arm.urdf", "w") as file:
    file.write(TEXT)
model = pinocchio.buildModelFromXML(TEXT)
data = model.createData()
pinocchio.framesForwardKinematics(model, data, np.array([0.5]))
other = mujoco.MjModel.from_xml_string(TEXT)
state = mujoco.MjData(other)
state.qpos[0] = 0.5
mujoco.mj_kinematics(other, state)
chain = ikpy.chain.Chain.from_urdf_file("arm.urdf", base_elements=["base"])
matrices = {
    "kinpy": kinpy.build_chain_from_urdf(TEXT.replace('<mujoco><compiler fusestatic="false"/></mujoco>', "")).forward_kinematics({"hip": 0.5})["tip"].matrix()[:3, :3],
    "ikpy": chain.forward_kinematics([0.5 if link.name == "hip" else 0.0 for link in chain.links])[:3, :3],
    "Pinocchio": data.oMf[model.getFrameId("tip")].rotation,
    "MuJoCo": state.body("tip").xmat.reshape(3, 3),
}
found = {name: Rotation.from_matrix(matrix).as_rotvec() for name, matrix in matrices.items()}
print("turned by [rad]: " + "; ".join(f"{name} {np.round(vector, 3) + 0.0}" for name, vector in found.items()))
wanted = lambda name: (0, 0, 0.5) if name == "kinpy" else (0.5, 0, 0)
sys.exit(0 if all(np.allclose(vector, wanted(name), atol=1e-6) for name, vector in found.items()) else 1)
CODE
