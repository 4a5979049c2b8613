#!/bin/sh
# Pinocchio 4.1.0 (pin) takes density and size of geoms from MJCF's <default>, but not mass: such a geom weighs what its shape does in
# water. dm_control 1.0.50's acrobot, whose default is mass="1", has 2 kg in MuJoCo 4.0.1 and 16.4 kg in Pinocchio; its cartpole 1.1 and 7.7 kg.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check --no-deps --target "$folder/suite" dm_control==1.0.50
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin

import os

SUITE = "suite/dm_control/suite"
TEXT = """<mujoco model="m"><default><geom {}/></default><worldbody><body name="arm"><joint name="elbow" axis="0 1 0"/>
  <geom size=".1"/></body></worldbody></mujoco>"""


def masses(path):
    """The whole mass [kg] in MuJoCo and in Pinocchio."""
    model, other = mujoco.MjModel.from_xml_path(path), pin.buildModelFromMJCF(path)
    found = float(model.body_mass.sum()), pin.computeTotalMass(other)
    print(f"{os.path.basename(path)}: MuJoCo {found[0]:.4g} kg, Pinocchio {found[1]:.4g} kg")
    return found


for name in ("mass", "density"):
    with open(f"{name}.xml", "w") as file:
        file.write(TEXT.format(f'{name}="2"'))
mass, density = masses("mass.xml"), masses("density.xml")
acrobot, cartpole = (masses(f"{SUITE}/{name}.xml") for name in ("acrobot", "cartpole"))
so = abs(density[0] - density[1]) < 1e-9 and mass[0] == 2.0 and mass[1] > 4.0 and acrobot[1] > 8.0 * acrobot[0] > 0.0
sys.exit(0 if so and cartpole[1] > 6.0 * cartpole[0] else 1)
CODE
