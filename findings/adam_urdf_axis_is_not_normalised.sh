#!/bin/sh
# adam-robotics 0.5.0: a revolute joint of a URDF whose axis is not of length one, such as axis="1 1 0", has a velocity that is too large by that length, in Jacobians, mass matrix and
# torques, and a pose that is no rotation. Pinocchio 4.1.0 (pin) and MuJoCo take the direction of the axis only. Nothing is said.
# Seen: axis "1 1 0" at 0.5 rad: the joint's inertia is 0.700 kg m^2 in place of 0.350, the determinant of the link's rotation 1.03; with "0.7071067811865476 0.7071067811865476 0" both agree.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check adam-robotics==0.5.0 pin==4.1.0 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
import pinocchio as pin
from adam.numpy import KinDynComputations

LINK = '<inertial><origin xyz="{}" rpy="0 0 0"/><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
ROBOT = (
    '<robot name="arm"><link name="base">' + LINK.format("0 0 0") + '</link><link name="link">' + LINK.format("0 0 -.5") + "</link>"
    '<joint name="joint" type="revolute"><parent link="base"/><child link="link"/><origin xyz="0 0 0" rpy="0 0 0"/><axis xyz="{}"/>'
    '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>'
)
angle, found = np.array([0.5]), {}
for axis in ("1 1 0", "0.7071067811865476 0.7071067811865476 0"):
    robot = KinDynComputations(ROBOT.format(axis), ["joint"])
    pose = np.asarray(robot.forward_kinematics("link", np.eye(4), angle))
    model = pin.buildModelFromXML(ROBOT.format(axis))
    mass = float(np.asarray(robot.mass_matrix(np.eye(4), angle))[6, 6]), float(pin.crba(model, model.createData(), angle)[0, 0])
    point = float(np.linalg.norm(pose[:3, :3] @ np.array([0.0, 0.0, -0.5])))
    found[axis] = float(np.linalg.det(pose[:3, :3])), point, *mass
    print(f'axis "{axis}": determinant {found[axis][0]:.3f}, a point at 0.5 m is at {point:.3f} m, joint inertia {mass[0]:.3f}, by Pinocchio {mass[1]:.3f} kg m^2')
bad, good = found.values()
sys.exit(0 if abs(bad[0] - 1) > 0.01 and bad[2] > 1.5 * bad[3] and np.allclose(good[:3], (1, 0.5, good[3]), atol=1e-9) and abs(bad[3] - good[3]) < 1e-9 else 1)
CODE
