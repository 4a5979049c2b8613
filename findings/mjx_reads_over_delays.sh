#!/bin/sh
# MJX 3.17.0 (mujoco-mjx): `put_model` refuses what MJX cannot do (an adhesion actuator: NotImplementedError), but not these settings of MJCF, which it reads over: `delay` of an actuator and of a
# sensor, `actearly`, and the second numbers of a joint's `damping` and `stiffness`. MuJoCo 3.17.0 keeps all of them. A policy that is trained with MJX knows no delay though the file has one.
# Seen: after 2 steps of 5 ms at rest, with a delay of 20 ms before a motor of 3 N m: MuJoCo 0 rad/s, MJX moves; a delayed joint sensor reads the value of now.
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

TEXT = """<mujoco><option timestep="0.005" gravity="0 0 0"/><worldbody><body><joint name="hip" axis="0 1 0" armature="0.1" {joint}/>
  <geom size=".1" mass="1"/></body></worldbody><actuator><general joint="hip" gainprm="3" {actuator}/></actuator>
  <sensor><jointvel joint="hip" {sensor}/></sensor></mujoco>"""
CASES = {
    "plain": {},
    "actuator's delay": {"actuator": 'delay="0.02" nsample="5"'},
    "actearly": {"actuator": 'dyntype="filter" dynprm="0.02" actearly="true"'},
    "damping and stiffness of two numbers": {"joint": 'damping="1 2" stiffness="5 50" springref="40"'},
    "sensor's delay": {"sensor": 'delay="0.02" nsample="5"'},
}
differ = {}
for name, words in CASES.items():
    model = mujoco.MjModel.from_xml_string(TEXT.format(**{"joint": "", "actuator": "", "sensor": "", **words}))
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    ours, other = mjx.put_model(model), mjx.put_data(model, data)
    for _ in range(2):
        mujoco.mj_step(model, data)
        other = mjx.step(ours, other)
    pair = [(float(state.qvel[0]), float(state.sensordata[0])) for state in (data, other)]
    differ[name] = not np.allclose(*pair, atol=1e-6)
    print(f"{name}: velocity and its sensor [rad/s]: MuJoCo {pair[0][0]:.4f}, {pair[0][1]:.4f}; MJX {pair[1][0]:.4f}, {pair[1][1]:.4f}")
sys.exit(0 if not differ.pop("plain") and all(differ.values()) else 1)
CODE
