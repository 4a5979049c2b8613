#!/bin/sh
# A link of a URDF without <inertial> has no mass: so the format says, and so read Pinocchio 4.1.0 (pin) and Drake 1.51.1. MuJoCo 4.0.1
# weighs its collision shapes with the density of water, as it does in MJCF: a camera's box of 10 cm, fixed to an arm of 2 kg, adds 1 kg to it.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pin==4.1.0 mujoco-core==4.0.1 numpy==2.4.6 drake==1.51.1
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

LINK = '<link name="{}"><inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
TEXT = (
    '<robot name="r"><link name="world"/>' + LINK.format("arm") + '<link name="camera">{}</link><joint name="elbow" type="continuous">'
    '<parent link="world"/><child link="arm"/><axis xyz="0 1 0"/></joint><joint name="mount" type="fixed"><parent link="arm"/>'
    '<child link="camera"/></joint></robot>'
)
BOX = '<{0}><geometry><box size=".1 .1 .1"/></geometry></{0}>'


def masses(inside):
    """The mass [kg] of what moves, in MuJoCo, Pinocchio and Drake."""
    text = TEXT.format(inside)
    model, other, plant = mujoco.MjModel.from_xml_string(text), pin.buildModelFromXML(text), MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.Finalize()
    found = float(model.body_mass.sum()), pin.computeTotalMass(other), plant.CalcTotalMass(plant.CreateDefaultContext())
    print("MuJoCo {:.4g} kg, Pinocchio {:.4g} kg, Drake {:.4g} kg:".format(*found), inside or "no shapes")
    return [round(each, 9) for each in found]


so = masses("") == masses(BOX.format("visual")) == [2.0, 2.0, 2.0] and masses(BOX.format("collision")) == [3.0, 2.0, 2.0]
sys.exit(0 if so else 1)
CODE
