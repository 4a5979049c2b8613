#!/bin/sh
# crocoddyl 3.2.1, as `pip install crocoddyl` lays it today with libpinocchio 4.1.0 (its requirement has no version): DifferentialActionModelFreeFwdDynamics, the forward
# dynamics of its arms, has no gravity. Inertia, Coriolis terms and derivatives by the control are right, nothing is said, and the solver finds its optimum for another robot. With libpinocchio 4.0.0 it
# is the `aba` of Pinocchio. An armature that is set, even of zeros, leads another way through the code, and gravity is back with both.
# Seen: an arm let go at a random pose: with 4.1.0 acceleration 0 where aba has up to 8.4 rad/s^2, with the armature set to zeros that of aba.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/drop.py" <<'CODE'
import sys

import crocoddyl
import numpy as np
import pinocchio

model = pinocchio.buildSampleModelManipulator()
pinocchio.seed(1)
q, rest = pinocchio.randomConfiguration(model), np.zeros(model.nv)
state = crocoddyl.StateMultibody(model)
action = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, crocoddyl.ActuationModelFull(state), crocoddyl.CostModelSum(state))


def acceleration():
    data = action.createData()
    action.calc(data, np.concatenate([q, rest]), rest)
    return np.array(data.xout)


plain = acceleration()
action.armature = np.zeros(model.nv)
found = {"aba": pinocchio.aba(model, model.createData(), q, rest, rest), "crocoddyl": plain, "armature set to zeros": acceleration()}
print(f"libpinocchio {pinocchio.__version__}, acceleration at rest [rad/s^2]: " + "; ".join(f"{name} {np.round(a, 2) + 0.0}" for name, a in found.items()))
same = lambda a, b: np.allclose(a, b, atol=1e-6)
assert same(found["aba"], found["armature set to zeros"])
sys.exit(0 if same(plain, found["aba"]) else 3 if np.abs(plain).max() < 1e-6 < 1.0 < np.abs(found["aba"]).max() else 1)
CODE
for version in 4.0.0 4.1.0; do
  python3 -m venv "$folder/$version"
  "$folder/$version/bin/python" -m pip install -q --disable-pip-version-check crocoddyl==3.2.1 libpinocchio==$version numpy==2.4.6
done
"$folder/4.0.0/bin/python" -W ignore "$folder/drop.py"
code=0
"$folder/4.1.0/bin/python" -W ignore "$folder/drop.py" || code=$?
test $code -eq 3
