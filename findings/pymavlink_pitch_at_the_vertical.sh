#!/bin/sh
# pymavlink 2.4.50: `Matrix3.to_euler`, and with it `Quaternion.euler`, gives a pitch of -180 deg for a nose straight up and of +180 deg for one straight down: where the sine
# reaches one by rounding, half of the headings, it writes pi in place of -pi/2. QuaternionBase has the pitch right and loses the heading: within 0.06 deg of straight down
# it is 0 or 180 deg, whatever it was. A tail-sitter, a rocket or a camera that looks down is there all the time; its log shows jumps of 270 deg.
# Seen: of 360 quaternions of single precision with a pitch of 90 deg 182 come back with a pitch of -180 deg; SciPy 1.17.1 has 90 deg for all.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pymavlink==2.4.50 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from pymavlink.quaternion import Quaternion, QuaternionBase
from pymavlink.rotmat import Matrix3
from scipy.spatial.transform import Rotation


def as_sent(pitch, yaw):
    """w, x, y, z of an attitude [deg], rounded as in ATTITUDE_QUATERNION, with float32 fields."""
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, 0.0], degrees=True).as_quat()
    return [float(value) for value in np.float32([w, x, y, z])]


up = [as_sent(90.0, yaw) for yaw in range(360)]
pitches = np.degrees([Quaternion(q).euler[1] for q in up])
of_scipy = [Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", degrees=True)[1] for q in up]
wrong = int(np.sum(np.abs(pitches + 180.0) < 1e-3))
print(f"nose up, 360 headings: pitch of -180 deg {wrong} times; SciPy {min(of_scipy):.2f} to {max(of_scipy):.2f} deg")

matrix = Matrix3()
matrix.from_euler(0.0, -np.pi / 2.0, 0.0)
down = np.degrees(matrix.to_euler()[1])
print(f"from_euler(pitch=-90 deg).to_euler(): pitch {down:.2f} deg")

back = [np.degrees(QuaternionBase(as_sent(-90.0, yaw)).euler) for yaw in (30.0, 75.0, 120.0)]
print("QuaternionBase, nose down, heading 30, 75, 120 deg:", [f"pitch {one[1]:.2f}, heading {one[2]:.2f}" for one in back])
lost = all(abs(one[2] - yaw) > 10.0 and abs(one[1] + 90.0) < 0.1 for one, yaw in zip(back, (30.0, 75.0, 120.0)))
sys.exit(0 if wrong > 100 and abs(down - 180.0) < 1e-6 and lost and min(of_scipy) > 89.9 else 1)
CODE
