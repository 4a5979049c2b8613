#!/bin/sh
# crocoddyl 3.2.1 (with libpinocchio 4.0.0): the gradient of a cost on a frame's velocity, ResidualModelFrameVelocity, is wrong by the joints' angles for LOCAL_WORLD_ALIGNED, the reference in which "the foot's speed
# along the ground" is written. The cost itself is right; LOCAL and WORLD are right in both. At rest all agree. The solver takes it for a gradient and gains less than it expects, or turns away.
# Seen: a cost on the tool of Pinocchio's sample manipulator at a random state, against crocoddyl's own DifferentialActionModelNumDiff: off by 2.2 where the greatest entry is 2.4; LOCAL and WORLD below 1e-5.
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

model = pin.buildSampleModelManipulator()
rng = np.random.default_rng(0)
x, u = np.concatenate([rng.uniform(-1, 1, model.nq), rng.normal(size=model.nv)]), rng.normal(size=model.nv)
state = crocoddyl.StateMultibody(model)
actuation = crocoddyl.ActuationModelFull(state)
found = {}
for reference in (pin.LOCAL, pin.WORLD, pin.LOCAL_WORLD_ALIGNED):
    wanted = pin.Motion(np.array([0.5, -0.3, 0.2, 0.1, 0.4, -0.6]))
    residual = crocoddyl.ResidualModelFrameVelocity(state, model.nframes - 1, wanted, reference, actuation.nu)
    costs = crocoddyl.CostModelSum(state, actuation.nu)
    costs.addCost("velocity", crocoddyl.CostModelResidual(state, residual), 1.0)
    action = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
    differences = crocoddyl.DifferentialActionModelNumDiff(action, False)
    told, truth = action.createData(), differences.createData()
    for one, data in ((action, told), (differences, truth)):
        one.calc(data, x, u)
        one.calcDiff(data, x, u)
    found[str(reference)] = np.abs(told.Lx - truth.Lx).max(), np.abs(truth.Lx).max(), np.abs((told.Lx - truth.Lx)[model.nv :]).max()
    print(f"crocoddyl {crocoddyl.__version__}, {reference}: cost {told.cost:.3f}, greatest entry of its gradient {found[str(reference)][1]:.2f}, error {found[str(reference)][0]:.1e}, by velocities alone {found[str(reference)][2]:.0e}")
bad = found.pop("LOCAL_WORLD_ALIGNED")
sys.exit(0 if bad[0] > 0.3 * bad[1] and bad[2] < 1e-4 and max(error for error, _, _ in found.values()) < 1e-4 else 1)
CODE
