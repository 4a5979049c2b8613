#!/bin/sh
# Pinocchio 4.1.0 (pin): the `axisangle` of an MJCF body is used as it stands. MuJoCo makes the axis a unit vector; Pinocchio
# turns by a matrix that is no rotation where the axis is not of length one, and builds the model without a word.
# Seen: axisangle "1 2 0 40": the tip of a link of 0.3 m lies 0.65 m from MuJoCo's, and the determinant of the placement is 9.4;
# with the axis of length one both agree.
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


def compare(axis):
    """Return the tips' distance in metres and the determinant of the body's placement in Pinocchio."""
    text = f"""<mujoco><worldbody><body name="arm" pos="0 0 1" axisangle="{' '.join(map(repr, map(float, axis)))} 40"><joint axis="0 1 0"/>
      <geom size=".1"/><site name="tip" pos=".3 0 0"/></body></worldbody></mujoco>"""
    Path("robot.xml").write_text(text)
    simulated, model = mujoco.MjModel.from_xml_string(text), pinocchio.buildModelFromMJCF("robot.xml")
    data, own = mujoco.MjData(simulated), model.createData()
    mujoco.mj_forward(simulated, data)
    pinocchio.framesForwardKinematics(model, own, np.zeros(1))
    placed = own.oMf[model.getFrameId("tip")]
    return float(np.linalg.norm(data.site("tip").xpos - placed.translation)), float(np.linalg.det(placed.rotation))


axis = np.array([1.0, 2.0, 0.0])
long, unit = compare(axis), compare(axis / np.linalg.norm(axis))
for name, (apart, determinant) in (("axis of length 2.24", long), ("axis of length 1", unit)):
    print(f"pinocchio {pinocchio.__version__}: {name}: tips {apart:.3f} m apart, determinant of the rotation {determinant:.3f}")
sys.exit(0 if long[0] > 0.1 and abs(long[1] - 1) > 0.1 and unit[0] < 1e-12 else 1)
CODE
