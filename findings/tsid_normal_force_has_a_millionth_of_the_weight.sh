#!/bin/sh
# tsid 1.7.1: addRigidContact(point, weight, ...) weighs the square of the force along the ground by `weight`, but along the normal by a millionth of it: ContactPoint begins with the factors (1, 1, 0.001)
# before the squares, which setRegularizationTaskWeightVector replaces. Where friction does not bind the forces hardly show it. Where it does, the feet share the load otherwise: beside a program with one
# weight by 1.4 of 20 N, and 0.12 N m of a biped's torques.
# Seen: the diagonal of the quadratic program's Hessian is 1, 1, 1e-6 for the weight 1, and 1, 1, 1 after the factors are set.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/weights.py" <<'CODE'
import sys

import numpy as np
import pinocchio as pin
from tsid import tsid_pywrap as tsid

model = pin.Model()
base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
model.appendBodyToJoint(base, pin.Inertia.Random(), pin.SE3.Identity())
leg = model.addJoint(base, pin.JointModelRX(), pin.SE3.Identity(), "leg")
model.appendBodyToJoint(leg, pin.Inertia.Random(), pin.SE3.Identity())
model.addFrame(pin.Frame("foot", leg, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
robot = tsid.RobotWrapper(model, tsid.RootJointType.FLOATING_BASE_SYSTEM, False)
q, v = pin.neutral(model), np.zeros(model.nv)


def weights_of_the_force(chosen):
    program = tsid.InverseDynamicsFormulationAccForce("program", robot, False)
    program.computeProblemData(0.0, q, v)
    point = tsid.ContactPoint("foot", robot, "foot", np.array([0.0, 0.0, 1.0]), 0.5, 0.0, 100.0)
    if chosen is not None:
        point.setRegularizationTaskWeightVector(np.array(chosen))
    program.addRigidContact(point, 1.0, 1.0, True)
    solver = tsid.SolverHQuadProgFast("solver")
    solver.resize(program.nVar, program.nEq, program.nIn)
    solver.retrieveQPData(program.computeProblemData(0.0, q, v))
    return np.diag(np.array(solver.qpData.H))[-3:]


plain, chosen = weights_of_the_force(None), weights_of_the_force([1.0, 1.0, 1.0])
print(f"along the ground, across, along the normal: {np.round(plain, 7)}; with factors set: {np.round(chosen, 6)}")
assert np.allclose(chosen, 1.0, atol=1e-6)
sys.exit(0 if np.allclose(plain, [1.0, 1.0, 1e-6], rtol=0.1) else 1)
CODE
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install -q --disable-pip-version-check --only-binary :all: tsid==1.7.1 pin==3.4.0 cmeel-urdfdom==4.0.1 "cmeel-tinyxml2<11" numpy==2.2.6
"$folder/venv/bin/python" -W ignore "$folder/weights.py"
