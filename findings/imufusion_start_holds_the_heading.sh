#!/bin/sh
# imufusion 1.3.3: for the first 3 s the filter without a magnetometer holds the heading at zero, whatever the gyroscope says; the
# other axes are free. A robot that turns while its program starts has a heading that is off by that whole turn for the
# rest of the run, and no error tells so; the flag `startup` is the only sign. `skip_startup()` before the first sample avoids it.
# Seen: 4 s at 20 deg/s about the vertical give 20 deg in place of 80; with skip_startup 80.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" imufusion==1.3.3 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import imufusion
import numpy as np

RATE, TURN, SECONDS = 100, 20.0, 4.0  # Hz, deg/s, s; the filter's own sample rate is 100 Hz


def heading(skip):
    ahrs = imufusion.Ahrs()
    if skip:
        ahrs.skip_startup()
    for _ in range(round(RATE * SECONDS)):
        ahrs.update_no_magnetometer(np.array([0.0, 0.0, TURN]), np.array([0.0, 0.0, 1.0]))
    return float(imufusion.quaternion_to_euler(ahrs.get_quaternion())[2])


plain, skipped = heading(False), heading(True)
print(f"imufusion 1.3.3: {SECONDS:g} s at {TURN:g} deg/s are a heading of {plain:.1f} deg, with skip_startup {skipped:.1f} deg")
sys.exit(0 if abs(plain - 20.0) < 1.0 and abs(skipped - 80.0) < 0.5 else 1)
CODE
