#!/bin/sh
# AHRS 0.4.0: `Quaternion(rpy=...)` and `DCM(rpy=...)` take the same angles, in radians, with the same names, and are two attitudes: the matrix turns about z by the "roll" and about x by the "yaw". `DCM.to_rpy` is
# the inverse of neither: it gives the angles of the inverse attitude.
# Expected: three ways through one package give back the angles that went in; the package documents "roll->pitch->yaw" for all. Seen for (0.1, 0.2, 0.3): Quaternion and back (0.1, 0.2, 0.3), DCM and back
# (-0.286, -0.220, -0.038), Quaternion, its matrix and back (-0.038, -0.220, -0.286); SciPy 1.17.1 reads (0.1, 0.2, 0.3) of the quaternion's matrix and (0.3, 0.2, 0.1) of DCM's.
# A single angle about x and one about z alone show half of it: signs turn, and roll and yaw change places.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check ahrs==0.4.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from ahrs import DCM, Quaternion
from scipy.spatial.transform import Rotation


def judge(matrix):
    """Roll, pitch and yaw by SciPy: about the moved axes z, y, x."""
    return Rotation.from_matrix(np.asarray(matrix)).as_euler("ZYX")[::-1]


found = {}
for given in ((0.1, 0.2, 0.3), (0.4, 0.0, 0.0), (0.0, 0.0, 0.4)):
    quaternion, matrix = Quaternion(rpy=given), DCM(rpy=given)
    found[given] = rows = {
        "Quaternion, back": quaternion.to_angles(),
        "DCM, back": matrix.to_rpy(),
        "Quaternion, its matrix, back": DCM(quaternion.to_DCM()).to_rpy(),
        "Quaternion's matrix by SciPy": judge(quaternion.to_DCM()),
        "DCM by SciPy": judge(matrix),
    }
    for name, angles in rows.items():
        print(f"AHRS 0.4.0: {given}, {name}: {np.round(np.asarray(angles) + 0.0, 3)}")
right = True
for given, rows in found.items():
    inverse = judge(np.asarray(Quaternion(rpy=given).to_DCM()).T)
    right &= np.allclose(rows["Quaternion, back"], given) and np.allclose(rows["Quaternion's matrix by SciPy"], given)
    right &= np.allclose(rows["DCM by SciPy"], given[::-1]) and np.allclose(rows["Quaternion, its matrix, back"], inverse)
    right &= not np.allclose(rows["DCM, back"], given)
sys.exit(0 if right else 1)
CODE
