#!/bin/sh
# Pinocchio 4.1.0 (pin) converts the range of MJCF slide joints from degrees, as if a length were an angle: +-1 m become +-0.0175 m. With
# angle="radian" it does not. It also moves the range of a joint by its `ref`, though its coordinate is MuJoCo's, so a hinge with ref 90 and
# range 0 to 180 gets -90 to 90 degrees. MuJoCo 4.0.1 reads both as they are documented.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin

import numpy as np

SLIDE = """<mujoco model="m"><compiler angle="{}"/><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"
  range="-1 1"/><geom size=".1"/></body></worldbody></mujoco>"""
HINGE = """<mujoco model="m"><worldbody><body name="arm"><joint name="elbow" axis="0 1 0" ref="90" range="0 180"/>
  <geom size=".1" pos="0 0 -1"/></body></worldbody></mujoco>"""


def both(text):
    """The range and, at 0.3, the place of the CoM in either program."""
    with open("m.xml", "w") as file:
        file.write(text)
    model, other = mujoco.MjModel.from_xml_path("m.xml"), pin.buildModelFromMJCF("m.xml")
    data = mujoco.MjData(model)
    data.qpos[:] = 0.3
    mujoco.mj_forward(model, data)
    com = pin.centerOfMass(other, other.createData(), np.full(1, 0.3))
    limits = other.lowerPositionLimit[0], other.upperPositionLimit[0]
    same = np.allclose(com, data.subtree_com[1], atol=1e-9)
    print(f"MuJoCo {np.round(model.jnt_range[0], 4)}, Pinocchio {np.round(limits, 4)}; the same coordinate: {same}")
    return np.array(limits) - model.jnt_range[0], same


degrees, _ = both(SLIDE.format("degree"))
radians, _ = both(SLIDE.format("radian"))
moved, same = both(HINGE)
so = (
    np.allclose(np.abs(degrees), 1.0 - np.pi / 180.0) and np.allclose(radians, 0.0) and np.allclose(moved, -np.pi / 2.0) and same
)
sys.exit(0 if so else 1)
CODE
