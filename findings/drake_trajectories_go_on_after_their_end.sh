#!/bin/sh
# Drake 1.51.1 (pydrake): after its last time (and before its first) a trajectory holds its value, but its derivative is not zero: `EvalDerivative` and `MakeDerivative` of PiecewisePolynomial,
# BsplineTrajectory, BezierCurve and PiecewiseQuaternionSlerp hold the last speed. A controller that takes both from the trajectory is told "stay here" and "go on at 2.5 rad/s" for as long as it runs.
# PiecewisePose is at odds with itself: GetVelocity gives zero (as it says), EvalDerivative the last speed of both parts.
# Expected: zero, the derivative of a value that no longer changes, as central differences say. TrajectorySource does it that way.
# Seen, half a second after the end: 2.5 (polynomial), -9 (B-spline), -3 (Bezier), 1 rad/s (slerp); PiecewisePose zero in GetVelocity, 1 rad/s and 1 m/s in EvalDerivative.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check drake==1.51.1 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from pydrake.math import BsplineBasis, KnotVectorType, RigidTransform, RollPitchYaw
from pydrake.trajectories import BezierCurve, BsplineTrajectory, PiecewisePolynomial, PiecewisePose, PiecewiseQuaternionSlerp

points = [np.array([[float(x)]]) for x in (0, 1, 3, 2, 5, 4)]
turns = [RollPitchYaw(0, 0, angle) for angle in (0.0, 1.0, 2.0)]
late, small = 2.5, 1e-6
paths = {
    "PiecewisePolynomial": PiecewisePolynomial.CubicShapePreserving([0, 1, 2.0], np.array([[0, 1, 3.0]])),
    "BsplineTrajectory": BsplineTrajectory(BsplineBasis(4, 6, KnotVectorType.kClampedUniform, 1, 2.0), points),
    "BezierCurve": BezierCurve(1, 2, np.array([[0, 1, 3, 2.0]])),
    "PiecewiseQuaternionSlerp": PiecewiseQuaternionSlerp([0, 1, 2.0], [turn.ToQuaternion() for turn in turns]),
}
good, going = True, True
for name, path in paths.items():
    moved = float(np.abs(path.value(late + small) - path.value(late - small)).max() / (2 * small))
    told = [np.ravel(path.EvalDerivative(late, 1)), np.ravel(path.MakeDerivative(1).value(late))]
    print(f"Drake 1.51.1, {name}: the value moves at {moved:.1g}, EvalDerivative {told[0].round(6)}, MakeDerivative {told[1].round(6)}")
    good, going = good and moved < 1e-9, going and all(np.abs(rate).max() > 0.5 for rate in told)
pose = PiecewisePose.MakeLinear([0, 1, 2.0], [RigidTransform(turn, [at, 0, 0]) for turn, at in zip(turns, (0, 1, 2), strict=True)])
moved = np.abs(pose.GetPose(late + small).GetAsMatrix34() - pose.GetPose(late - small).GetAsMatrix34()).max()
velocity, derivative = np.ravel(pose.GetVelocity(late)), np.ravel(pose.EvalDerivative(late, 1))
print(f"PiecewisePose: moves by {moved:.1g}, GetVelocity {velocity.round(6)}, EvalDerivative {derivative.round(6)} (rad/s, m/s)")
odd = moved < 1e-9 and not velocity.any() and np.allclose(derivative, (0, 0, 1, 1, 0, 0), atol=1e-6)
sys.exit(0 if good and going and odd else 1)
CODE
