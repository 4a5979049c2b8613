#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): under RK4 a delayed actuator acts before its delay has passed. The last stage of a step stands
# at the step's end and reads the control that is due there, one step early, with a sixth of the weight: a pulse of one step
# is spread over two. Without a delay the control is constant over the step, and Euler and implicitfast delay by whole steps.
# Seen: a pulse delayed by three steps of 2 ms gives 0.167 of its impulse after two steps and 0.833 after three.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" mujoco-core==4.0.1 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import mujoco


def impulses(integrator, delayed):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.002" integrator="{integrator}"/>
      <worldbody><body><joint name="rail" type="slide" axis="1 0 0"/><geom size=".1" mass="1"/></body></worldbody>
      <actuator><motor joint="rail" {'nsample="3" delay="0.006"' if delayed else ""}/></actuator></mujoco>""")
    data = mujoco.MjData(model)
    shares = []
    for tick in range(6):
        data.ctrl[0] = 1.0 if tick == 0 else 0.0
        before = data.qvel[0]
        mujoco.mj_step(model, data)
        shares.append(round(float(data.qvel[0] - before) / 0.002, 3))
    return shares


seen = {(name, delayed): impulses(name, delayed) for name in ("Euler", "implicitfast", "RK4") for delayed in (False, True)}
for (name, delayed), shares in seen.items():
    print(f"mujoco {mujoco.mj_versionString()}: {name}, {'delay of 3 steps' if delayed else 'no delay'}: {shares}")
at_once, whole, early = [1, 0, 0, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0.167, 0.833, 0, 0]
expected = {(name, False): at_once for name in ("Euler", "implicitfast", "RK4")}
expected |= {("Euler", True): whole, ("implicitfast", True): whole, ("RK4", True): early}
sys.exit(0 if seen == expected else 1)
CODE
