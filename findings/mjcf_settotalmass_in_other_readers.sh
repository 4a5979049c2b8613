#!/bin/sh
# The masses of an MJCF file are those that MuJoCo's compiler makes of it, and neither Pinocchio 4.1.0 (pin) nor Drake 1.51.1 knows the
# compiler's settings `settotalmass`, `boundmass` and `inertiagrouprange`; Drake warns, Pinocchio says nothing. Every half cheetah of dm_control and
# Gymnasium 1.4.0 has settotalmass="14": 14 kg in MuJoCo 4.0.1, 21.18 kg in both of the others.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6 drake==1.51.1 gymnasium==1.4.0
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin

import os

import gymnasium
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

TEXT = """<mujoco model="m"><compiler {}/><worldbody><body name="arm"><joint name="elbow" axis="0 1 0"/><geom size=".1" group="0"/>
  <geom size=".1" group="3"/></body></worldbody></mujoco>"""


def masses(path, what):
    """The whole mass [kg] in MuJoCo, Pinocchio and Drake."""
    model, other, plant = mujoco.MjModel.from_xml_path(path), pin.buildModelFromMJCF(path), MultibodyPlant(0.001)
    Parser(plant).AddModels(path)
    plant.Finalize()
    found = float(model.body_mass.sum()), pin.computeTotalMass(other), plant.CalcTotalMass(plant.CreateDefaultContext())
    print("{}: MuJoCo {:.4g} kg, Pinocchio {:.4g} kg, Drake {:.4g} kg".format(what, *found))
    return found


def small(setting):
    with open("m.xml", "w") as file:
        file.write(TEXT.format(setting))
    return masses("m.xml", setting or "no setting")


usual = small("")
changed = [small(each) for each in ('settotalmass="5"', 'boundmass="20"', 'inertiagrouprange="0 1"')]
cheetah = masses(os.path.join(os.path.dirname(gymnasium.__file__), "envs/mujoco/assets/half_cheetah.xml"), "half_cheetah.xml")
so = max(usual) - min(usual) < 1e-9 and abs(cheetah[0] - 14.0) < 1e-9 and min(cheetah[1:]) > 21.0
so = so and all(abs(each[1] - usual[1]) < 1e-9 and abs(each[2] - usual[2]) < 1e-9 and abs(each[0] - usual[0]) > 1.0 for each in changed)
sys.exit(0 if so else 1)
CODE
