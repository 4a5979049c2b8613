#!/bin/sh
# modern_robotics 1.1.1: MatrixExp3 and MatrixExp6 take a rotation below a millionth of a radian for none. Who integrates an angular velocity
# with them at 1 kHz never turns below 1 mrad/s (0.06 deg/s), however long it lasts: a gyroscope's bias, or a slow drift of the base, is
# lost without a word. Pinocchio 4.1.0 (pin) and SciPy 1.17.1 turn by what is asked for.
# Seen: 20,000 steps of 0.9e-6 rad: 0 rad in place of 0.018; of 1.1e-6 rad: 0.022 as it should.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "modern-robotics==1.1.1" "pin==4.1.0" "numpy==2.4.6" "scipy==1.17.1"
"$folder/venv/bin/python" - <<'CODE'
import sys

import modern_robotics as mr
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

STEPS = 20_000
turned = {}
for angle in (0.9e-6, 1.1e-6):
    step = np.array([0.0, 0.0, angle])
    one = {
        "MatrixExp3": mr.MatrixExp3(mr.VecToso3(step)),
        "MatrixExp6": mr.MatrixExp6(mr.VecTose3(np.concatenate([step, np.zeros(3)])))[:3, :3],
        "pin": pin.exp3(step),
        "scipy": Rotation.from_rotvec(step).as_matrix(),
    }
    for name, matrix in one.items():
        whole = np.eye(3)
        for _ in range(STEPS):
            whole = whole @ matrix
        turned[angle, name] = float(round(np.arctan2(whole[1, 0], whole[0, 0]), 6))
        print(f"{name}: {STEPS} steps of {angle} rad: {turned[angle, name]} rad")
lost = turned[0.9e-6, "MatrixExp3"] == turned[0.9e-6, "MatrixExp6"] == 0.0
right = all(turned[angle, name] == round(STEPS * angle, 6) for angle in (0.9e-6, 1.1e-6) for name in ("pin", "scipy"))
sys.exit(0 if lost and right and turned[1.1e-6, "MatrixExp3"] == 0.022 else 1)
CODE
