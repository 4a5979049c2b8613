#!/bin/sh
# Pinocchio 4.1.0 (pin) reads the first body of MJCF's <worldbody> and leaves out all others without a word, and so it does with bodies
# inside <frame>; MuJoCo 4.0.1 reads all. A robot in two trees, or behind an obstacle, comes back as its
# first part: of Gymnasium 1.4.0's pusher, whose ball and goal are bodies beside the arm, 7 of 11 velocities and 0.18 of 13.67 kg are left.
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

BODY = '<body name="{0}"><joint name="joint_{0}" axis="0 1 0"/><geom size=".1" mass="1"/>{1}</body>'
INNER = '<frame pos="0 0 1">' + BODY.format("b", "") + "</frame>"


def size(path):
    """Velocities and mass [kg] in MuJoCo and in Pinocchio."""
    model, other = mujoco.MjModel.from_xml_path(path), pin.buildModelFromMJCF(path)
    found = int(model.nv), other.nv, float(model.body_mass.sum()), pin.computeTotalMass(other)
    print("{}: {} and {} velocities, {:.4g} and {:.4g} kg".format(os.path.basename(path), *found))
    return found


for name, bodies in (("beside.xml", BODY.format("a", "") + BODY.format("b", "")), ("frame.xml", BODY.format("a", INNER))):
    with open(name, "w") as file:
        file.write(f'<mujoco model="m"><worldbody>{bodies}</worldbody></mujoco>')
beside, frame = size("beside.xml"), size("frame.xml")
pusher = size(os.path.join(os.path.dirname(gymnasium.__file__), "envs/mujoco/assets/pusher_v5.xml"))
so = beside == frame == (2, 1, 2.0, 1.0) and pusher[:2] == (11, 7) and pusher[3] < 0.02 * pusher[2]
sys.exit(0 if so else 1)
CODE
