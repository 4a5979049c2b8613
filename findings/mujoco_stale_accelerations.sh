#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): a step that is made of its documented parts, mj_step1, mj_fwdActuation, mj_fwdAcceleration,
# mj_fwdConstraint and mj_sensorAcc, has a wrong accelerometer from the second step on. mj_sensorAcc takes the body
# accelerations (cacc) of an earlier step, though qacc is the present one; mj_step2, which makes the same calls, and a fresh
# mj_forward of the same state give the right reading. Calling mj_rnePostConstraint before mj_sensorAcc mends it.
# Seen: the accelerometer of a swinging pendulum differs by metres per second squared from that of mj_forward.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" mujoco-core==4.0.1 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import mujoco
import numpy as np

model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body pos="0 0 2"><joint axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -1" size=".05"/><site name="tip" pos="0 0 -1"/></body></worldbody>
  <sensor><accelerometer site="tip"/></sensor></mujoco>""")
parts = ("mj_fwdActuation", "mj_fwdAcceleration", "mj_fwdConstraint", "mj_sensorAcc")


def largest(names):
    data, fresh, worst = mujoco.MjData(model), mujoco.MjData(model), 0.0
    data.qpos[0] = 1.5
    mujoco.mj_step1(model, data)
    for _ in range(200):
        fresh.qpos[:], fresh.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(model, fresh)
        for name in names:
            getattr(mujoco, name)(model, data)
        worst = max(worst, float(np.abs(data.sensordata - fresh.sensordata).max()))
        if names != ("mj_step2",):
            mujoco.mj_Euler(model, data)
        mujoco.mj_step1(model, data)
    return worst


plain, mended, whole = largest(parts), largest((*parts[:3], "mj_rnePostConstraint", parts[3])), largest(("mj_step2",))
print(f"MuJoCo {mujoco.__version__}: the accelerometer differs from mj_forward's by up to {plain:.3g} m/s^2;")
print(f"with mj_rnePostConstraint before mj_sensorAcc by {mended:.1e} m/s^2; after mj_step2 by {whole:.1e} m/s^2")
sys.exit(0 if plain > 0.1 and mended < 1e-9 and whole < 1e-9 else 1)
CODE
