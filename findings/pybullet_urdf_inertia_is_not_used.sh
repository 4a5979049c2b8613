#!/bin/sh
# PyBullet 3.2.7: `loadURDF` reads the mass of a link and not its inertia: that is computed anew from the box around its collision shape, unless the flag
# URDF_USE_INERTIA_FROM_FILE is given; a link without a collision shape has none about its own centre. And every link has a linear and an angular damping
# of 0.04 that no file asked for: what coasts comes to rest, hinges without joint damping, too. Torques that are made by another model do not fit.
# Seen: inertia 0.5, 0.6, 0.7 in the file, 0.0017 three times in PyBullet; a hinge of 0.25 + 0.1 kg m^2 has 0.25, and 0.35 with the flag;
# after 5 s without gravity 73% of its speed are left, 100% after changeDynamics(linearDamping=0, angularDamping=0).
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pybullet==3.2.7" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - 2>/dev/null <<'CODE'
import sys

import pybullet as bullet

INERTIAL = '<inertial><origin xyz="{} 0 0"/><mass value="1"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial>'
BODY = f'<robot name="body"><link name="body">{INERTIAL.format(0, 0.5, 0.6, 0.7)}<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>'
ARM = (
    f'<robot name="arm"><link name="world">{INERTIAL.format(0, 1, 1, 1)}</link><link name="arm">{INERTIAL.format(0.5, 0.1, 0.1, 0.1)}</link>'
    '<joint name="hinge" type="continuous"><parent link="world"/><child link="arm"/><axis xyz="0 0 1"/></joint></robot>'
)
for name, text in {"body.urdf": BODY, "arm.urdf": ARM}.items():
    with open(name, "w") as file:
        file.write(text)
bullet.connect(bullet.DIRECT)
inertias, masses, left = {}, {}, {}
for flag in (0, bullet.URDF_USE_INERTIA_FROM_FILE):
    inertias[flag] = [round(each, 4) for each in bullet.getDynamicsInfo(bullet.loadURDF("body.urdf", flags=flag), -1)[2]]
    masses[flag] = round(bullet.calculateMassMatrix(bullet.loadURDF("arm.urdf", useFixedBase=True, flags=flag), [0.0])[0][0], 3)
for undamped in (False, True):
    bullet.resetSimulation()
    arm = bullet.loadURDF("arm.urdf", useFixedBase=True, flags=bullet.URDF_USE_INERTIA_FROM_FILE)
    bullet.setJointMotorControl2(arm, 0, bullet.VELOCITY_CONTROL, force=0)
    for link in (-1, 0):
        if undamped:
            bullet.changeDynamics(arm, link, linearDamping=0, angularDamping=0)
    bullet.resetJointState(arm, 0, 0.0, 1.0)
    for _ in range(5 * 240):
        bullet.stepSimulation()
    left[undamped] = round(bullet.getJointState(arm, 0)[1], 4)
print(f"pybullet 3.2.7: inertia {inertias[0]}, with the flag {list(inertias.values())[1]}; hinge {masses}; speed after 5 s {left}")
flagged = bullet.URDF_USE_INERTIA_FROM_FILE
right = inertias[flagged] == [0.5, 0.6, 0.7] and masses[flagged] == 0.35 and left[True] == 1.0
sys.exit(0 if right and max(inertias[0]) < 0.002 and masses[0] == 0.25 and left[False] < 0.9 else 1)
CODE
