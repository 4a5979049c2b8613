#!/bin/sh
# Roll, pitch and yaw of a pose that looks straight up or down: roll and yaw turn about one axis there, and SciPy 1.17.1 and Pinocchio 4.1.0 (pin) choose a pair whose attitude is the given one. mink 1.3.0
# (`SO3.as_rpy_radians`) and symforce-sym 0.12.0 (`Rot3.to_yaw_pitch_roll`) do not: their angles are another attitude, and for some poses mink gives NaN.
# A camera that looks down, a wrist of an arm and a tail-sitter stand so by design. A millionth of a radian away all four are right.
# Seen: 338 poses with a pitch of +-90 deg: mink NaN for 64, and up to 170 deg off; symforce up to 160 deg off; SciPy and Pinocchio below 1e-9 deg.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check mink==1.3.0 symforce-sym==0.12.0 pin==4.1.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import mink
import numpy as np
import pinocchio
import sym
from scipy.spatial.transform import Rotation

READERS = {
    "mink": lambda pose: np.asarray(mink.SO3(pose.as_quat(scalar_first=True)).as_rpy_radians()),
    "symforce": lambda pose: np.asarray(sym.Rot3(list(pose.as_quat())).to_yaw_pitch_roll(), float).ravel()[::-1],
    "SciPy": lambda pose: pose.as_euler("ZYX")[::-1],
    "Pinocchio": lambda pose: pinocchio.rpy.matrixToRpy(pose.as_matrix()),
}
found = {}
for away in (0.0, 1e-6):
    grid = np.linspace(-3.0, 3.0, 13)
    poses = [Rotation.from_euler("ZYX", [yaw, sign * (np.pi / 2.0 - away), roll]) for sign in (1.0, -1.0) for yaw in grid for roll in grid]
    for name, read in READERS.items():
        angles = [read(pose) for pose in poses]
        errors = [np.degrees((pose.inv() * Rotation.from_euler("ZYX", rpy[::-1])).magnitude()) for pose, rpy in zip(poses, angles) if np.all(np.isfinite(rpy))]
        found[name, away] = max(errors), len(poses) - len(errors), sum(error > 1.0 for error in errors)
        print(f"{away} rad from the vertical, {name}: up to {found[name, away][0]:.1e} deg off, {found[name, away][2]} of {len(poses)} by more than 1 deg, {found[name, away][1]} NaN")
near = all(value[0] < 1e-4 and value[1] == 0 for (name, away), value in found.items() if away or name in ("SciPy", "Pinocchio"))
sys.exit(0 if near and found["mink", 0.0][1] > 0 and found["mink", 0.0][2] > 50 and found["symforce", 0.0][2] > 50 else 1)
CODE
