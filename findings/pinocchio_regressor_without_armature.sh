#!/bin/sh
# Pinocchio (PyPI: pin 4.1.0): `rnea` adds the rotors' inertia of `model.armature`, `computeJointTorqueRegressor` does not.
#
# The regressor is the one "that links the joint torque to the dynamic parameters of each link according to the current the robot
# motion", and without armature Y pi is rnea's torque to rounding. With model.armature set the difference is armature * a, and nothing
# says so: an identification by Y from measured torques puts the rotors into the links, and residuals by rnea and by Y differ. The
# right side has to be tau - armature * a, or a column for each rotor is added.
#
# Exits 0 while this is so.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import pinocchio as pin

model = pin.buildSampleModelManipulator()
rng = np.random.default_rng(0)
q, v, a = pin.randomConfiguration(model), rng.normal(size=model.nv), rng.normal(size=model.nv)
links = np.concatenate([model.inertias[k].toDynamicParameters() for k in range(1, model.njoints)])


def difference() -> np.ndarray:
    data = model.createData()
    rows = pin.computeJointTorqueRegressor(model, data, q, v, a)
    return pin.rnea(model, model.createData(), q, v, a) - rows @ links


without = difference()
model.armature = np.linspace(0.1, 0.6, model.nv)
with_rotors = difference()
print("pin", pin.__version__)
print("rnea - Y pi without armature:", np.abs(without).max())
print("rnea - Y pi with armature:   ", with_rotors.round(4))
print("armature * acceleration:     ", (model.armature * a).round(4))
assert np.abs(without).max() < 1e-9
assert np.allclose(with_rotors, model.armature * a), "the regressor has the rotors now"
assert np.abs(with_rotors).max() > 0.05
PYTHON
