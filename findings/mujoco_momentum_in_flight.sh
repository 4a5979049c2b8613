#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): without gravity, contacts and outer forces a floating body that swings a limb by its motor gains
# linear momentum with the integrators Euler and implicitfast, in proportion to the timestep, though the base's velocity is a
# coordinate of its own in the world. RK4 keeps it to rounding.
# Seen: the centre of mass of a 5 kg body with a 1 kg leg moves at 0.51 mm/s within 0.4 s at 0.5 ms, at 0.26 mm/s at 0.25 ms, and at
# 1e-9 mm/s with RK4; that of a biped of 5 kg with ten joints at 10 mm/s.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" mujoco-core==4.0.1 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import mujoco
import numpy as np

TEXT = """<mujoco><option gravity="0 0 0" integrator="{}" timestep="{}"/><worldbody><body name="trunk"><freejoint/>
  <geom type="box" size=".1 .1 .1" mass="5"/><body pos="0 0 -.1"><joint name="hip" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1" contype="0"/></body></body></worldbody>
  <actuator><motor joint="hip"/></actuator></mujoco>"""


def speed(integrator, timestep):
    model = mujoco.MjModel.from_xml_string(TEXT.format(integrator, timestep))
    data, fastest = mujoco.MjData(model), 0.0
    for k in range(round(0.4 / timestep)):
        phase = 5.0 * np.pi * k * timestep
        data.ctrl[0] = 60.0 * (0.5 * np.sin(phase) - data.qpos[7]) + 2.5 * np.pi * np.cos(phase) - data.qvel[6]
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        fastest = max(fastest, float(np.linalg.norm(data.subtree_linvel[1])))
    return 1e3 * fastest


found = {(name, step): speed(name, step) for name in ("Euler", "implicitfast", "implicit", "RK4") for step in (5e-4, 2.5e-4)}
for (name, step), value in found.items():
    print(f"MuJoCo {mujoco.__version__}, {name} at {1e3 * step:g} ms: the centre of mass moves at {value:.2g} mm/s")
grows = all(1.8 < found[n, 5e-4] / found[n, 2.5e-4] < 2.2 for n in ("Euler", "implicitfast"))
sys.exit(0 if grows and found["implicitfast", 5e-4] > 0.2 and found["RK4", 5e-4] < 1e-5 else 1)
CODE
