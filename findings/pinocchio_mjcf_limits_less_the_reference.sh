#!/bin/sh
# Pinocchio 4.1.0 (pin): of an MJCF joint with `ref` it takes the angles as MuJoCo does (the same q, the same place), but the
# limits less `ref`: the model forbids angles that the file allows, and allows angles that the file forbids. For hinges and slides.
# Seen: range -10 to 50 deg with ref 30: MuJoCo -10 to 50, Pinocchio -40 to 20; the tips at q = 0.4 rad are one point.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "mujoco-core==4.0.1" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'CODE'
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

FILE = """<mujoco><compiler angle="radian"/><worldbody><body pos="0 0 1"><joint type="{0}" axis="0 1 0" ref="{1}" range="{2} {3}"/>
  <geom size=".1"/><site name="tip" pos=".3 0 0"/></body></worldbody></mujoco>"""
kept = True
for kind, reference, lower, upper in (("hinge", 0.5, -0.2, 0.9), ("slide", 0.1, -0.05, 0.2)):
    text = FILE.format(kind, reference, lower, upper)
    Path("robot.xml").write_text(text)
    simulated, model = mujoco.MjModel.from_xml_string(text), pinocchio.buildModelFromMJCF("robot.xml")
    data, own = mujoco.MjData(simulated), model.createData()
    data.qpos[0] = 0.15
    mujoco.mj_forward(simulated, data)
    pinocchio.framesForwardKinematics(model, own, np.array([0.15]))
    apart = abs(data.site("tip").xpos - own.oMf[model.getFrameId("tip")].translation).max()
    told = model.lowerPositionLimit[0], model.upperPositionLimit[0]
    print(f"{kind} with ref {reference}: MuJoCo {simulated.jnt_range[0]}, Pinocchio {pinocchio.__version__} {np.round(told, 3)}; tips {apart:.0e} m apart")
    kept &= apart < 1e-12 and np.allclose(told, (lower - reference, upper - reference)) and np.allclose(simulated.jnt_range[0], (lower, upper))
sys.exit(0 if kept else 1)
CODE
