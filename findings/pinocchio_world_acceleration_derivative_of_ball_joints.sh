#!/bin/sh
# Pinocchio 4.1.0 (pin): getJointAccelerationDerivatives and getFrameAccelerationDerivatives with WORLD are wrong by q for a ball joint, a planar or a free joint that hangs on a link that moves, though LOCAL of the
# same call is right and WORLD is right for hinges, for slides, and for such a joint at the root, which is where most have theirs. A second robot on a moving base, a shoulder or a hip as
# a ball joint is not. The columns of that joint are off; the others are right.
# Seen: hinge, joint, hinge at a random state, against finite differences: ball, planar and free joint off by 1 to 6 in WORLD, below 1e-7 in LOCAL; with hinges, translations, and a ball joint first, all below 1e-7.
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

HINGE, BALL = pin.JointModelRX, pin.JointModelSpherical
CHAINS = {
    "hinge": (HINGE, pin.JointModelRZ, pin.JointModelRY), "translation": (HINGE, pin.JointModelTranslation, pin.JointModelRY), "ball first": (BALL, HINGE, pin.JointModelRY),
    "ball": (HINGE, BALL, pin.JointModelRY), "planar": (HINGE, pin.JointModelPlanar, pin.JointModelRY), "free": (HINGE, pin.JointModelFreeFlyer, pin.JointModelRY),
}
rng, step, found = np.random.default_rng(2), 1e-6, {}
for name, chain in CHAINS.items():
    model, last = pin.Model(), 0
    for number, joint in enumerate(chain):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-0.5, 0.5, 3))
        last = model.addJoint(last, joint(), place, f"joint{number}")
        model.appendBodyToJoint(last, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-1, 1, model.nv))
    v, a = rng.normal(size=model.nv), rng.normal(size=model.nv)

    def acceleration(q, reference):
        data = model.createData()
        pin.forwardKinematics(model, data, q, v, a)
        return np.array(pin.getAcceleration(model, data, last, reference).vector)

    data = model.createData()
    pin.computeForwardKinematicsDerivatives(model, data, q, v, a)
    for reference in (pin.LOCAL, pin.WORLD):
        told = np.array(pin.getJointAccelerationDerivatives(model, data, last, reference)[1])
        moved = [(pin.integrate(model, q, e), pin.integrate(model, q, -e)) for e in step * np.eye(model.nv)]
        truth = np.array([(acceleration(up, reference) - acceleration(down, reference)) / (2 * step) for up, down in moved]).T
        found[name, str(reference)] = np.abs(told - truth).max()
    print(f"pin {pin.__version__}, {name}: error of da/dq: LOCAL {found[name, 'LOCAL']:.0e}, WORLD {found[name, 'WORLD']:.2g}")
bad = [found[name, "WORLD"] for name in ("ball", "planar", "free")]
good = [error for (name, reference), error in found.items() if reference == "LOCAL" or name not in ("ball", "planar", "free")]
sys.exit(0 if min(bad) > 0.2 and max(good) < 1e-6 else 1)
CODE
