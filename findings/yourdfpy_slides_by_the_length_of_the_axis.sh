#!/bin/sh
# yourdfpy 0.0.60: a prismatic joint moves by its value times the length of its axis. Pinocchio 4.1.0 (pin), MuJoCo 4.0.1 and urchin 0.0.30 give the
# axis the length one, and so does yourdfpy for revolute joints. A slide along the diagonal, written axis="1 1 0", goes 41% too far; one with
# axis="0 0 0.5" half the way. The format says that the axis "should" be normalised and no reader of the four complains.
# Seen: 0.3 m along "1 1 0": 0.4243 m in yourdfpy, 0.3 m in the others.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "yourdfpy==0.0.60" "urchin==0.0.30" "pin==4.1.0" "mujoco-core==4.0.1" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'CODE'
import sys

import mujoco
import numpy as np
import pinocchio as pin
import urchin
import yourdfpy

URDF = """<robot name="slide"><link name="rail"/><link name="slider"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="slide" type="prismatic">
<parent link="rail"/><child link="slider"/><axis xyz="{}"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>"""
told = {}
for axis in ("0 0 1", "1 1 0", "0 0 0.5"):
    with open("slide.urdf", "w") as file:
        file.write(URDF.format(axis))
    model, simulated = pin.buildModelFromUrdf("slide.urdf"), mujoco.MjModel.from_xml_path("slide.urdf")
    data, state = model.createData(), mujoco.MjData(simulated)
    pin.forwardKinematics(model, data, np.array([0.3]))
    state.qpos[0] = 0.3
    mujoco.mj_forward(simulated, state)
    robot = yourdfpy.URDF.load("slide.urdf", load_meshes=False)
    robot.update_cfg([0.3])
    placed = urchin.URDF.load("slide.urdf").link_fk(cfg={"slide": 0.3}, use_names=True)["slider"]
    places = [robot.get_transform("slider", "rail")[:3, 3], placed[:3, 3], data.oMi[1].translation, state.xpos[-1]]
    told[axis] = [float(round(np.linalg.norm(place), 4)) for place in places]
    print(f"axis {axis}: 0.3 m move yourdfpy 0.0.60, urchin, pin, mujoco by {told[axis]} m")
sys.exit(0 if told["0 0 1"] == [0.3] * 4 and told["1 1 0"] == [0.4243] + [0.3] * 3 and told["0 0 0.5"] == [0.15] + [0.3] * 3 else 1)
CODE
