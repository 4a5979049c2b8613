#!/bin/sh
# Pinocchio 4.1.0 (pin): a joint of several degrees of freedom whose axes move with its own angles is exact in rnea, crba and aba, but not in what is differentiated: derivatives of gravity,
# rnea and aba, the Coriolis matrix, the time derivative of Jacobians and of the centroidal momentum take its axes for fixed in its link. Nothing is raised. Such joints are JointModelComposite,
# Universal, SphericalZYX and Ellipsoid, and the MJCF reader makes a composite of every body with two or more hinges, such as a hip. The same hinges one after the other, on links without mass,
# are the same robot, and right.
# Seen: a leg with a hip of two hinges in one body, and in two: one mass matrix and one torque; with one body the derivative of gravity is off by 14% of its greatest entry, that of rnea by 25%,
# the Coriolis torque C(q, v) v by 42%, the foot's dJ/dt by four times; with two bodies all agree with finite differences.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 numpy==2.4.6
cat > "$folder/one.xml" <<'MJCF'
<mujoco><compiler angle="radian"/><worldbody><body name="thigh">
<joint name="roll" axis="1 0 0"/><joint name="pitch" axis="0 1 0"/>
<inertial pos="0.02 0.01 -0.2" mass="3" diaginertia="0.03 0.02 0.01"/>
<body name="shank" pos="0 0 -0.4"><joint name="knee" axis="0 1 0"/><inertial pos="0 0.01 -0.2" mass="1" diaginertia="0.01 0.01 0.002"/></body>
</body></worldbody></mujoco>
MJCF
cat > "$folder/two.xml" <<'MJCF'
<mujoco><compiler angle="radian"/><worldbody><body name="hip"><joint name="roll" axis="1 0 0"/>
<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/><body name="thigh"><joint name="pitch" axis="0 1 0"/>
<inertial pos="0.02 0.01 -0.2" mass="3" diaginertia="0.03 0.02 0.01"/>
<body name="shank" pos="0 0 -0.4"><joint name="knee" axis="0 1 0"/><inertial pos="0 0.01 -0.2" mass="1" diaginertia="0.01 0.01 0.002"/></body>
</body></body></worldbody></mujoco>
MJCF
"$folder/env/bin/python" - "$folder" <<'CODE'
import sys

import numpy as np
import pinocchio as pin

q, v, a, step = np.array([0.3, -0.5, 0.9]), np.array([1.0, -2.0, 1.5]), np.array([0.5, 1.0, -1.0]), 1e-6
ALL = {}


def full(matrix):
    return np.triu(matrix) + np.triu(matrix, 1).T


def jacobian(model, q):
    return np.array(pin.computeFrameJacobian(model, model.createData(), q, model.getFrameId("shank"), pin.LOCAL))


def slopes(function):
    return np.array([(function(q + e) - function(q - e)) / (2 * step) for e in step * np.eye(3)]).T


for name in ("one", "two"):
    model = pin.buildModelFromMJCF(f"{sys.argv[1]}/{name}.xml")
    data = model.createData()
    found = ALL[name] = {"joints": [joint.shortname() for joint in model.joints][1:], "M": full(pin.crba(model, data, q)).copy(), "tau": pin.rnea(model, data, q, v, a).copy()}
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    bias = pin.rnea(model, data, q, v, 0 * v) - gravity
    pin.computeRNEADerivatives(model, data, q, v, a)
    found["drnea/dq"] = np.array(data.dtau_dq), slopes(lambda x: pin.rnea(model, model.createData(), x, v, a))
    found["dg/dq"] = np.array(pin.computeGeneralizedGravityDerivatives(model, data, q)), slopes(lambda x: pin.computeGeneralizedGravity(model, model.createData(), x))
    found["C v"] = pin.computeCoriolisMatrix(model, data, q, v) @ v, bias
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.updateFramePlacements(model, data)
    rate = pin.getFrameJacobianTimeVariation(model, data, model.getFrameId("shank"), pin.LOCAL)
    found["dJ/dt"] = np.array(rate), (jacobian(model, q + step * v) - jacobian(model, q - step * v)) / (2 * step)
one, two = ALL["one"], ALL["two"]
print(f"pin {pin.__version__}: joints {one['joints']} and {two['joints']}")
same = max(np.abs(one[key] - two[key]).max() for key in ("M", "tau"))
print(f"mass matrix and torque of both differ by {same:.0e}")
good, bad = [same < 1e-9], []
for key in ("drnea/dq", "dg/dq", "C v", "dJ/dt"):
    error = {name: np.abs(np.subtract(*ALL[name][key])).max() for name in ALL}
    size = np.abs(two[key][1]).max()
    good.append(error["two"] < 1e-5)
    bad.append(error["one"] > 0.1 * size)
    print(f"{key}: greatest entry {size:.2f}, error with one body {error['one']:.2f}, with two {error['two']:.0e}")
sys.exit(0 if all(good) and all(bad) else 1)
CODE
