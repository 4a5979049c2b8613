#!/bin/sh
# Pinocchio 4.1.0 (pin) gives no mass to MJCF geoms with contype="0" conaffinity="0", even to those with a mass= of their own; in MuJoCo
# 4.0.1 what a geom touches has nothing to do with what it weighs. Gymnasium 1.4.0's swimmer has all three links so: 106.8 kg in MuJoCo,
# 0 kg in Pinocchio, whose mass matrix is that of the rotors alone. Nothing is said.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6 gymnasium==1.4.0
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin

import os

import gymnasium

TEXT = """<mujoco model="m"><worldbody><body name="arm"><joint name="elbow" axis="0 1 0"/>
  <geom size=".1" mass="3" {}/></body></worldbody></mujoco>"""


def masses(path):
    """The whole mass [kg] in MuJoCo and in Pinocchio."""
    model, other = mujoco.MjModel.from_xml_path(path), pin.buildModelFromMJCF(path)
    found = float(model.body_mass.sum()), pin.computeTotalMass(other)
    print(f"{os.path.basename(path)}: MuJoCo {found[0]:.4g} kg, Pinocchio {found[1]:.4g} kg")
    return found


for name, more in (("touches.xml", ""), ("touches_nothing.xml", 'contype="0" conaffinity="0"')):
    with open(name, "w") as file:
        file.write(TEXT.format(more))
usual, without = masses("touches.xml"), masses("touches_nothing.xml")
swimmer = masses(os.path.join(os.path.dirname(gymnasium.__file__), "envs/mujoco/assets/swimmer.xml"))
so = usual[0] == usual[1] == without[0] == 3.0 and without[1] == 0.0 and swimmer[0] > 100.0 and swimmer[1] == 0.0
sys.exit(0 if so else 1)
CODE
