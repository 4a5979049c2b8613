#!/bin/sh
# vqf 2.1.2: with its defaults the filter takes a steady turn below 2 deg/s for rest, and the rate for the gyroscope's bias, after 1.5 s. The heading of a base that turns slowly on the spot, of a camera head that pans or of a
# mower along a wide bend stands still, and with it the angular velocity that the filter corrects. Nothing is said but in `restDetected` and the bias.
# Expected: a perfect gyroscope (no bias, no noise) is integrated; the estimate of a bias about the vertical, which nothing but rest shows, needs more than a slow rate. Seen: 40 s at 1.5 deg/s are a heading of 2.5 degrees in place of 60,
# bias 1.5 deg/s; at 2.5 deg/s 100 degrees, as it should be. restBiasEstEnabled=False gives 60. In noise as of a real sensor it is the same.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check vqf==2.1.2 numpy==2.4.6
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
import vqf

STEP, SECONDS = 0.01, 40.0
samples = round(SECONDS / STEP)
random = np.random.default_rng(0)


def heading(rate, noise=0.0, **settings):
    """Heading (deg) and bias about z (deg/s) after a turn about the vertical at a rate (deg/s)."""
    gyro, force = np.zeros((samples, 3)), np.tile([0.0, 0.0, 9.81], (samples, 1))
    gyro[:, 2] = np.radians(rate)
    gyro += random.normal(0.0, noise * np.radians(0.1), gyro.shape)
    force += random.normal(0.0, noise * 0.02, force.shape)
    out = vqf.VQF(STEP, **settings).updateBatch(gyro, force)
    angle = np.unwrap(2.0 * np.arctan2(out["quat6D"][:, 3], out["quat6D"][:, 0]))
    return float(np.degrees(angle[-1])), float(np.degrees(out["bias"][-1, 2])), int(out["restDetected"].sum())


found = {}
for name, rate, settings in (("1.5", 1.5, {}), ("1.5, noise", 1.5, {"noise": 1.0}), ("2.5", 2.5, {}), ("1.5, no estimate at rest", 1.5, {"restBiasEstEnabled": False})):
    found[name] = turned, bias, rest = heading(rate, **settings)
    print(f"vqf 2.1.2, {SECONDS:g} s at {name} deg/s: {turned:.1f} deg in place of {rate * SECONDS:g}, bias {bias:.2f} deg/s, at rest in {rest} of {samples} samples")
lost = all(found[name][0] < 4.0 and abs(found[name][1] - 1.5) < 0.1 for name in ("1.5", "1.5, noise"))
sys.exit(0 if lost and abs(found["2.5"][0] - 100.0) < 1.0 and abs(found["1.5, no estimate at rest"][0] - 60.0) < 1.0 else 1)
CODE
