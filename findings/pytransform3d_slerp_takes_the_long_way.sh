#!/bin/sh
# pytransform3d 3.17.0: quaternion_slerp between q and a quaternion of the other sign goes the long way round, unless
# shortest_path=True is given. SciPy's Slerp, numpy-quaternion's slerp and spatialmath's interp go the short way. Estimators and
# motion capture change the sign of a quaternion at will, so an interpolated log turns by up to 360 deg within one sample.
# Seen: half-way between 0 and 200 deg (which is -160 deg): pytransform3d +100 deg, the others -80 deg.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" pytransform3d==3.17.0 numpy-quaternion==2024.0.13 \
  spatialmath-python==1.1.18 scipy==1.17.1 numpy==2.4.6
PYTHONPATH="$folder" MPLCONFIGDIR="$folder" python3 -W ignore - <<'CODE'
import sys

import numpy as np
import quaternion
from pytransform3d.rotations import quaternion_slerp
from scipy.spatial.transform import Rotation, Slerp
from spatialmath import UnitQuaternion

half = np.radians(100.0)
end = [np.cos(half), np.sin(half), 0.0, 0.0]  # w, x, y, z: 200 deg about x
degrees = lambda w, x: float(np.degrees(2.0 * np.arctan2(x, w)))
of_numpy = quaternion.slerp(quaternion.one, quaternion.quaternion(*end), 0.0, 1.0, np.array([0.5]))[0]
found = {
    "pytransform3d": degrees(*quaternion_slerp([1.0, 0.0, 0.0, 0.0], end, 0.5)[:2]),
    "pytransform3d, shortest_path=True": degrees(*quaternion_slerp([1.0, 0.0, 0.0, 0.0], end, 0.5, shortest_path=True)[:2]),
    "numpy-quaternion": degrees(of_numpy.w, of_numpy.x),
    "spatialmath": degrees(*UnitQuaternion([1, 0, 0, 0]).interp(UnitQuaternion(end), s=0.5).vec[:2]),
    "SciPy": float(Slerp([0, 1], Rotation.from_quat([[0, 0, 0, 1], [end[1], 0, 0, end[0]]]))(0.5).as_rotvec(degrees=True)[0]),
}
print("half-way from 0 to 200 deg: " + "; ".join(f"{name} {deg:+.0f}" for name, deg in found.items()))
near = lambda name, deg: abs((found[name] - deg + 180.0) % 360.0 - 180.0) < 1e-6
sys.exit(0 if near("pytransform3d", 100.0) and all(near(name, -80.0) for name in found if name != "pytransform3d") else 1)
CODE
