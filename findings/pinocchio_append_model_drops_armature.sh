#!/bin/sh
# Pinocchio 4.1.0 (pin): `appendModel` copies limits, damping, friction and rotor inertias of the model that it appends, but not
# `armature`, the one of them that its dynamics use: it is zero in the result, without a word. An arm that is mounted on a base has lost
# its rotors: small geared joints are several times too light in the mass matrix. `buildReducedModel` keeps it. Set it again afterwards.
# Seen: armature 0.3 kg m^2 of a joint with 0.054: mass matrix 0.354 alone and 0.054 on the base; torques for 1 rad/s^2 likewise.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'CODE'
import sys

import numpy as np
import pinocchio as pin


def hinge(name):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), name)
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.0])))
    model.addBodyFrame(name + "_link", joint, pin.SE3.Identity(), 0)
    model.armature, model.damping, model.rotorInertia = np.array([0.3]), np.array([0.4]), np.array([0.5])
    return model


base, arm = hinge("base"), hinge("arm")
both = pin.appendModel(base, arm, base.getFrameId("base_link"), pin.SE3.Identity())
reduced = pin.buildReducedModel(arm, [], pin.neutral(arm))
masses = {}
for name, model in {"alone": arm, "reduced": reduced, "appended": both}.items():
    masses[name] = pin.crba(model, model.createData(), pin.neutral(model))[-1, -1]
    print(f"pin 4.1.0: {name}: armature {model.armature}, damping {model.damping}, mass of the last joint {masses[name]:.4f}")
lost = np.isclose(masses["alone"] - masses["appended"], 0.3) and both.armature[-1] == 0
sys.exit(0 if lost and masses["reduced"] == masses["alone"] and both.damping[-1] == 0.4 and both.rotorInertia[-1] == 0.5 else 1)
CODE
