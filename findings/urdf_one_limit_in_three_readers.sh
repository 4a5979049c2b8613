#!/bin/sh
# A revolute joint of a URDF with upper="1" alone: the format's default of `lower` is 0. Pinocchio 4.1.0 (pin) reads 0 to 1, Drake 1.51.1
# minus infinity to 1, and MuJoCo 4.0.1 keeps the range 0 to 1 but does not limit the joint at all. Without both it is locked at 0 in Pinocchio and
# free in the others. Limits of a `continuous` joint limit it in Drake only. None of the three says a word.
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

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
TEXT = (
    '<robot name="r">' + LINK.format("base") + LINK.format("arm") + '<joint name="elbow" type="{}"><parent link="base"/>'
    '<child link="arm"/><axis xyz="0 1 0"/><limit effort="3" velocity="4" {}/></joint></robot>'
)


def limits(kind, written):
    """The joint's limits [rad] in MuJoCo, Pinocchio and Drake."""
    text = TEXT.format(kind, written)
    model, other, plant = mujoco.MjModel.from_xml_string(text), pin.buildModelFromXML(text), MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.Finalize()
    joint = plant.GetJointByName("elbow")
    free = (-np.inf, np.inf)
    found = [
        tuple(model.jnt_range[0].tolist()) if model.jnt_limited[0] else free,
        (other.lowerPositionLimit[0].item(), other.upperPositionLimit[0].item()) if other.nq == 1 else free,
        (joint.position_lower_limit(), joint.position_upper_limit()),
    ]
    print(f"{kind} with {written or 'neither limit'}: MuJoCo {found[0]}, Pinocchio {found[1]}, Drake {found[2]}")
    return found


inf = np.inf
so = limits("revolute", 'lower="-1" upper="1"') == [(-1.0, 1.0)] * 3
so &= limits("revolute", 'upper="1"') == [(-inf, inf), (0.0, 1.0), (-inf, 1.0)]
so &= limits("revolute", "") == [(-inf, inf), (0.0, 0.0), (-inf, inf)]
so &= limits("continuous", 'lower="-1" upper="1"') == [(-inf, inf), (-inf, inf), (-1.0, 1.0)]
sys.exit(0 if so else 1)
CODE
