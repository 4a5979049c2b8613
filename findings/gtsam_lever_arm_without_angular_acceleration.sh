#!/bin/sh
# GTSAM 4.3.0: `setBodyPSensor` of the preintegration says where on the robot the IMU sits. Of what the lever arm adds to its accelerometer only the centripetal part is taken away;
# the part of the angular acceleration, alpha x r, is integrated as if the robot moved. A robot whose turns begin and end, as a leg's hip or a body in flight, gets speeds of alpha r t.
# Expected: a body that turns about its own origin, with an IMU 0.5 m beside it and perfect readings, has a speed of 0. Seen: at a constant 2 rad/s it has; sped up with
# 10 rad/s^2 for 0.5 s it is at 2.33 m/s and has moved by 0.61 m. Nothing is said. An own integration of the same readings, with both parts taken away, gives 0.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check gtsam==4.3.0 numpy==2.4.6
"$folder/env/bin/python" - <<'CODE'
import sys

import gtsam
import numpy as np

ARM, STEP, SECONDS, GRAVITY = np.array([0.5, 0.0, 0.0]), 1e-4, 0.5, 9.81


def moved(rate, acceleration):
    """Speed (m/s) and distance (m) of a body that only turns about z: by GTSAM, and by an own integration with the whole lever arm."""
    settings = gtsam.PreintegrationParams.MakeSharedU(GRAVITY)
    for name in ("Accelerometer", "Gyroscope", "Integration"):
        getattr(settings, f"set{name}Covariance")(1e-6 * np.eye(3))
    settings.setBodyPSensor(gtsam.Pose3(gtsam.Rot3(), ARM))
    bias = gtsam.imuBias.ConstantBias()
    preintegrated = gtsam.PreintegratedImuMeasurements(settings, bias)
    velocity, angle = np.zeros(3), 0.0
    alpha = np.array([0.0, 0.0, acceleration])
    for step in range(round(SECONDS / STEP)):
        omega = np.array([0.0, 0.0, rate + acceleration * (step + 0.5) * STEP])
        reading = np.cross(alpha, ARM) + np.cross(omega, np.cross(omega, ARM)) + [0.0, 0.0, GRAVITY]
        preintegrated.integrateMeasurement(reading, omega, STEP)
        angle += omega[2] * STEP
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        of_body = reading - np.cross(alpha, ARM) - np.cross(omega, np.cross(omega, ARM))
        velocity = velocity + STEP * (turn @ of_body - [0.0, 0.0, GRAVITY])
    state = preintegrated.predict(gtsam.NavState(), bias)
    return float(np.linalg.norm(state.velocity())), float(np.linalg.norm(state.position())), float(np.linalg.norm(velocity))


found = {}
for rate, acceleration in ((2.0, 0.0), (0.0, 10.0)):
    found[acceleration] = speed, distance, own = moved(rate, acceleration)
    print(f"GTSAM 4.3.0: a body that turns on the spot, {rate:g} rad/s and {acceleration:g} rad/s^2 for {SECONDS} s: {speed:.3f} m/s, {distance:.3f} m; with both parts {own:.3f} m/s")
steady, sped_up = found[0.0], found[10.0]
sys.exit(0 if max(*steady, sped_up[2]) < 1e-6 and abs(sped_up[0] - 2.33) < 0.01 and abs(sped_up[1] - 0.606) < 0.01 else 1)
CODE
