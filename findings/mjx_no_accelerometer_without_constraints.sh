#!/bin/sh
# MJX 3.17.0 (mujoco-mjx): in a model without any constraint its forward step ends before the sensors of acceleration and force. An accelerometer, a force or torque sensor and an actuator's force
# read zero, though the motion is right and gyroscope and positions are, too. One joint limit, reached or not, and they are those of MuJoCo 3.17.0. So the IMU of a drone, or of an arm
# without limits and contacts, trains an estimator or a policy on zeros.
# Seen: a pendulum that falls under a torque of 0.5 N m: MuJoCo (6.14, 0, 3.66) m/s^2 and 0.5, MJX zeros; with a limit at +-170 deg both (6.14, 0, 3.66) and 0.5.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check mujoco==3.17.0 mujoco-mjx==3.17.0 jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6
JAX_PLATFORMS=cpu "$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import jax

jax.config.update("jax_enable_x64", True)
import mujoco
import numpy as np
from mujoco import mjx

TEXT = """<mujoco><worldbody><body pos="0 0 1"><joint name="hip" axis="0 1 0" {}/>
  <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/><site name="imu" pos=".1 0 .1"/></body></worldbody>
  <actuator><motor name="motor" joint="hip"/></actuator>
  <sensor><accelerometer site="imu"/><actuatorfrc actuator="motor"/><gyro site="imu"/></sensor></mujoco>"""
found = {}
for limit in ("", 'limited="true" range="-170 170"'):
    model = mujoco.MjModel.from_xml_string(TEXT.format(limit))
    data = mujoco.MjData(model)
    data.ctrl[0], data.qvel[0] = 0.5, 0.2
    other = mjx.forward(mjx.put_model(model), mjx.put_data(model, data))
    mujoco.mj_forward(model, data)
    assert np.allclose(other.qacc, data.qacc)
    found[limit] = np.array(data.sensordata), np.array(other.sensordata)
    for name, values in zip(("MuJoCo", "MJX"), found[limit]):
        print(f"{limit or 'no limit'}: {name}: accelerometer {np.round(values[:3], 2)}, motor {values[3]:.2f}, gyroscope {np.round(values[4:], 2)}")
(true, zero), (same, again) = found.values()
sys.exit(0 if np.all(zero[:4] == 0.0) and np.abs(true[:4]).max() > 1.0 and np.allclose(zero[4:], true[4:]) and np.allclose(same, again) else 1)
CODE
