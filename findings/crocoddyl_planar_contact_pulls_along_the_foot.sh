#!/bin/sh
# crocoddyl 3.2.1 (with libpinocchio 4.0.0): ContactModel2D, the contact of planar legs, corrects a foot that has left its place in wrong axes. The error of place is of the world, the constraint is
# in the axes of the frame, and nothing turns the one into the other. A foot that is turned by 90 deg is pushed sideways, by 180 deg away from its place. Its derivatives are right for what it
# does, so a check of them passes. ContactModel3D with the same gains, LOCAL or LOCAL_WORLD_ALIGNED, corrects towards the place. With a position gain of zero both agree.
# Seen: the foot 0.1 m beside its place, gain 30 1/s^2, at rest: ContactModel3D accelerates it by -3.0 m/s^2 along the error at any angle, ContactModel2D by -3.0, 0 and +3.0 m/s^2 for a foot turned by 0, 90 and 180 deg.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check crocoddyl==3.2.1 libpinocchio==4.0.0 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import crocoddyl
import numpy as np
import pinocchio as pin

model, last = pin.Model(), 0
for number, (joint, height) in enumerate(((pin.JointModelPX(), 0.0), (pin.JointModelPZ(), 0.0), (pin.JointModelRY(), 0.0), (pin.JointModelRY(), -0.1), (pin.JointModelRY(), -0.4))):
    last = model.addJoint(last, joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, height])), f"joint{number}")
    model.appendBodyToJoint(last, pin.Inertia(1.0, np.array([0.0, 0.0, -0.2]), 0.05 * np.eye(3)), pin.SE3.Identity())
foot = model.addFrame(pin.Frame("foot", last, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4])), pin.OP_FRAME))
state = crocoddyl.StateMultibody(model)
actuation = crocoddyl.ActuationModelFull(state)
rest, gains, found = np.zeros(model.nv), np.array([30.0, 0.0]), {}
for turn in (0.0, 90.0, 180.0):
    q = np.array([0.0, 0.5, np.radians(turn) - 0.7, 0.3, 0.4])
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    place = np.array(data.oMf[foot].translation) - np.array([0.1, 0.0, 0.0])
    contacts = {
        "2D": crocoddyl.ContactModel2D(state, foot, place[[0, 2]], actuation.nu, gains),
        "3D LOCAL": crocoddyl.ContactModel3D(state, foot, place, pin.LOCAL, actuation.nu, gains),
        "3D LOCAL_WORLD_ALIGNED": crocoddyl.ContactModel3D(state, foot, place, pin.LOCAL_WORLD_ALIGNED, actuation.nu, gains),
    }
    for name, contact in contacts.items():
        touching = crocoddyl.ContactModelMultiple(state, actuation.nu)
        touching.addContact("foot", contact)
        damping = 1e-9 if "3D" in name else 0.0
        action = crocoddyl.DifferentialActionModelContactFwdDynamics(state, actuation, touching, crocoddyl.CostModelSum(state, actuation.nu), damping, False)
        result = action.createData()
        action.calc(result, np.concatenate([q, rest]), np.zeros(actuation.nu))
        pin.forwardKinematics(model, data, q, rest, np.array(result.xout))
        pin.updateFramePlacements(model, data)
        found[name, turn] = np.array(pin.getFrameClassicalAcceleration(model, data, foot, pin.LOCAL_WORLD_ALIGNED).linear)
    print(f"foot turned by {turn:g} deg, 0.1 m beside its place along x; acceleration along x and z [m/s^2]: " + "; ".join(f"{name} {np.round(found[name, turn][[0, 2]], 3) + 0.0}" for name in contacts))
wanted = np.array([-3.0, 0.0, 0.0])
good = all(np.allclose(found[name, turn], wanted, atol=1e-3) for name, turn in found if name != "2D" or turn == 0.0)
sys.exit(0 if good and abs(found["2D", 90.0][0]) < 1e-3 and np.allclose(found["2D", 180.0], -wanted, atol=1e-3) else 1)
CODE
