#!/bin/sh
# Pinocchio 4.1.0 (pin, its Python package): getJointKinematicHessian gives an array of shape (6, nv, nv) whose numbers are the right ones in wrong places: they are laid out column by column and handed over as an array of rows,
# so that H[row, joint, angle] is some other entry. It is no transposition: no exchange of axes mends it, `H.ravel().reshape(H.shape, order="F")` does. Nothing is raised, shape and size look right.
# Seen: an arm of four hinges at a random place, against finite differences of getJointJacobian: LOCAL, WORLD and LOCAL_WORLD_ALIGNED off by about the greatest entry, in each of the two orders of joint and angle;
# read column by column they agree to 1e-9.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 numpy==2.4.6
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
import pinocchio as pin

model, rng, step = pin.Model(), np.random.default_rng(1), 1e-6
for number, joint in enumerate((pin.JointModelRX, pin.JointModelRZ, pin.JointModelRY, pin.JointModelRX)):
    model.addJoint(number, joint(), pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-0.5, 0.5, 3)), f"joint{number}")
q, last, good, bad = rng.uniform(-1, 1, model.nq), model.njoints - 1, [], []


def jacobian(q, reference):
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    return np.array(pin.getJointJacobian(model, data, last, reference))


for reference in (pin.LOCAL, pin.WORLD, pin.LOCAL_WORLD_ALIGNED):
    data = model.createData()
    pin.computeJointKinematicHessians(model, data, q)
    told = np.array(pin.getJointKinematicHessian(model, data, last, reference))
    truth = np.stack([(jacobian(q + e, reference) - jacobian(q - e, reference)) / (2 * step) for e in step * np.eye(model.nv)], axis=2)
    errors = np.abs(told - truth).max(), np.abs(told.transpose(0, 2, 1) - truth).max(), np.abs(told.ravel().reshape(told.shape, order="F") - truth).max()
    size = np.abs(truth).max()
    bad.append(min(errors[:2]) > 0.5 * size)
    good.append(errors[2] < 1e-6 and abs(np.abs(told).max() - size) < 1e-6)
    print(f"pin {pin.__version__}, {reference}: greatest entry of dJ/dq {size:.2f}; error of H[:, joint, angle] {errors[0]:.2f}, of H[:, angle, joint] {errors[1]:.2f}, read column by column {errors[2]:.0e}")
sys.exit(0 if all(good) and all(bad) else 1)
CODE
