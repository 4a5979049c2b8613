#!/bin/sh
# AHRS 0.4.0: the filters of this package share one interface, but AQUA's quaternion is the inverse of all others': it turns vectors
# of the world into the sensor, theirs those of the sensor into the world. Whoever exchanges one filter for another has roll and
# pitch with the wrong sign, and while the sensor lies level nothing shows it.
# Seen: a sensor that stands still, rolled by 0.5 rad: Tilt, Madgwick, Mahony, EKF, UKF, Complementary +28.6 deg, AQUA -28.6.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" ahrs==0.4.0 numpy==2.4.6
PYTHONPATH="$folder" python3 -W ignore - <<'CODE'
import sys

import numpy as np
from ahrs import filters

ROLL, SAMPLES = 0.5, 2000
specific_force = 9.81 * np.array([0.0, np.sin(ROLL), np.cos(ROLL)])  # of a sensor at rest, rolled about x, z up
acc, gyr = np.tile(specific_force, (SAMPLES, 1)), np.zeros((SAMPLES, 3))


def roll(name):
    kind = getattr(filters, name)
    w, x, _, _ = (kind(acc=acc) if name == "Tilt" else kind(gyr=gyr, acc=acc)).Q[-1]
    return float(np.degrees(2.0 * np.arctan2(x, w)))


found = {name: roll(name) for name in ("Tilt", "Madgwick", "Mahony", "EKF", "UKF", "Complementary", "AQUA")}
print("AHRS 0.4.0, roll of a sensor rolled by 28.6 deg: " + ", ".join(f"{name} {deg:+.1f}" for name, deg in found.items()))
wrong = [name for name, deg in found.items() if abs(deg + 28.6) < 1.0]
right = [name for name, deg in found.items() if abs(deg - 28.6) < 1.0]
sys.exit(0 if wrong == ["AQUA"] and len(right) == 6 else 1)
CODE
