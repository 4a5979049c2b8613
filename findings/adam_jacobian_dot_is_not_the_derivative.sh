#!/bin/sh
# adam-robotics 0.5.0: `jacobian_dot` ("the Jacobian time derivative") is not the derivative of `jacobian`, in none of its three representations. Only its product with the present velocity
# is right, which is what a test of the acceleration looks at. Whoever multiplies it with another velocity (that of a reference, in a passive controller), or needs its entries (the rate of
# the task's inertia), gets numbers that are wrong by their own size. Even the base link, whose Jacobian is the constant (1 0) in the mixed representation, has one.
# Seen: base and foot of a floating robot: entries off by up to more than 1, the product with the velocity by less than 1e-6.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check adam-robotics==0.5.0 numpy==2.4.6 scipy==1.17.1
cat > "$folder/leg.urdf" <<'URDF'
<robot name="leg"><link name="base"><inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="4"/><inertia ixx=".1" iyy=".2" izz=".3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="thigh"><inertial><origin xyz="0 0 -.2" rpy="0 0 0"/><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="foot"><inertial><origin xyz="0 0 -.2" rpy="0 0 0"/><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><origin xyz="0 .1 0" rpy="0 0 0"/><axis xyz="1 0 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="foot"/><origin xyz="0 0 -.4" rpy="0 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>
URDF
"$folder/env/bin/python" -W ignore - "$folder/leg.urdf" <<'CODE'
import sys

import numpy as np
from adam import Representations
from adam.numpy import KinDynComputations
from scipy.spatial.transform import Rotation

robot = KinDynComputations(sys.argv[1], ["hip", "knee"])
turn, place, angles = Rotation.from_rotvec([0.2, -0.4, 0.5]), np.array([0.5, -0.3, 0.8]), np.array([0.3, -0.7])
speed, spin, rates, step = np.array([0.4, -0.2, 0.6]), np.array([0.5, 1.0, -0.8]), np.array([1.5, -2.0]), 1e-6


def pose(time):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = (Rotation.from_rotvec(spin * time) * turn).as_matrix(), place + speed * time
    return matrix, angles + rates * time


rotate = turn.as_matrix().T
twists = {
    Representations.MIXED_REPRESENTATION: np.concatenate([speed, spin]),
    Representations.BODY_FIXED_REPRESENTATION: np.concatenate([rotate @ speed, rotate @ spin]),
    Representations.INERTIAL_FIXED_REPRESENTATION: np.concatenate([speed + np.cross(place, spin), spin]),
}
entries, products = [], []
for representation, twist in twists.items():
    robot.set_frame_velocity_representation(representation)
    for link in ("base", "foot"):
        truth = (robot.jacobian(link, *pose(step)) - robot.jacobian(link, *pose(-step))) / (2 * step)
        told = robot.jacobian_dot(link, *pose(0.0), twist, rates)
        product = np.abs((told - truth) @ np.concatenate([twist, rates])).max()
        entries.append(np.abs(told - truth).max())
        products.append(product)
        print(f"{representation.name} {link}: greatest entry of dJ/dt {np.abs(truth).max():.2f}, error {entries[-1]:.2f}, of its product with the velocity {product:.0e}")
sys.exit(0 if min(entries) > 0.3 and max(products) < 1e-6 else 1)
CODE
