#!/bin/sh
# pin 4.1.0: damping and friction of a URDF's joints are read into model.damping and model.friction, beside model.armature, but rnea,
# aba and crba use the armature only. A simulation by aba of a file with damping therefore swings for ever, and torques by rnea lack what
# the joint takes, without a word; whoever checks that the values arrived in the model finds them there.
# Seen: a pendulum at 2 rad/s with damping 0.5 N m s/rad: rnea's torque has no 1 N m of it; with an armature of 0.1 kg m^2 aba changes.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" pin==4.1.0 numpy==2.4.6
cat > "$folder/pendulum.urdf" <<'URDF'
<robot name="pendulum"><link name="base"/><link name="bob"><inertial><origin xyz="0 0 -1"/><mass value="1"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="bob"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="10" velocity="10"/><dynamics damping="0.5" friction="0.2"/></joint></robot>
URDF
site=$(dirname "$(find "$folder" -type d -name pinocchio -path '*site-packages*' | head -n 1)")
PYTHONPATH="$folder:$site" python3 - "$folder/pendulum.urdf" <<'CODE'
import sys

import numpy as np
import pinocchio as pin

model = pin.buildModelFromUrdf(sys.argv[1])
q, v, none = np.zeros(1), np.array([2.0]), np.zeros(1)
read = float(model.damping[0]), float(model.friction[0])
with_them = float(pin.rnea(model, model.createData(), q, v, none)[0]), float(pin.aba(model, model.createData(), q, v, none + 1.0)[0])
model.damping[:] = model.friction[:] = 0.0
without = float(pin.rnea(model, model.createData(), q, v, none)[0]), float(pin.aba(model, model.createData(), q, v, none + 1.0)[0])
model.armature[:] = 0.1
armed = float(pin.aba(model, model.createData(), q, v, none + 1.0)[0])
print(f"pin {pin.__version__}: read damping {read[0]:g}, friction {read[1]:g}; torque by rnea at 2 rad/s {with_them[0]:.3f} N m, without them")
print(f"{without[0]:.3f} N m; acceleration by aba {with_them[1]:.4f} and {without[1]:.4f}, with an armature of 0.1 {armed:.4f} rad/s^2")
sys.exit(0 if read == (0.5, 0.2) and with_them == without and abs(armed - without[1]) > 0.01 else 1)
CODE
