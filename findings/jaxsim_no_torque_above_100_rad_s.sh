#!/bin/sh
# jaxsim 0.9.0: in `step` a joint that turns at 100 rad/s or faster has no torque: what is commanded is cut to zero, and so are its damping and friction; from 30 rad/s on it may have less and less of 3000 N m. This is the
# torque-speed curve of a default motor (`ActuationParams`) that no file names, and that the file's <effort> has nothing to do with: that one is not kept. A wheel, a propeller or a rotor coasts for ever.
# Seen: a rotor of 0.35 kg m^2 with 3 N m and <effort>1</effort>: 8.57 rad/s^2, all of 3 N m, at 0, 20 and 99 rad/s, and zero at 101 and 1000 rad/s.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check jaxsim==0.9.0 rod==0.5.0 jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6
cat > "$folder/rotor.sdf" <<'SDF'
<sdf version="1.7"><model name="machine">
<link name="base"><inertial><mass>1</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<link name="rotor"><pose relative_to="hinge">0 0 0 0 0 0</pose><inertial><pose>0 0 0 0 0 0</pose><mass>1</mass>
<inertia><ixx>.35</ixx><iyy>.35</iyy><izz>.35</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<joint name="fixed" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="hinge" type="revolute"><pose relative_to="base">0 0 0 0 0 0</pose><parent>base</parent><child>rotor</child>
<axis><xyz>0 0 1</xyz><limit><lower>-1e9</lower><upper>1e9</upper><effort>1</effort></limit></axis></joint>
</model></sdf>
SDF
JAX_PLATFORMS=cpu JAX_ENABLE_X64=1 "$folder/env/bin/python" -W ignore - "$folder/rotor.sdf" <<'CODE'
import pathlib
import sys

import jax
import jax.numpy as jnp
import jaxsim.api as js

step, found = 1e-3, {}
model = js.model.JaxSimModel.build_from_model_description(pathlib.Path(sys.argv[1]).read_text(), time_step=step)
advance = jax.jit(lambda data: js.model.step(model, data, joint_force_references=jnp.array([3.0])))
for speed in (0.0, 20.0, 99.0, 101.0, 1000.0):
    data = js.data.JaxSimModelData.build(model, joint_positions=jnp.zeros(1), joint_velocities=jnp.array([speed]))
    found[speed] = (float(advance(data).joint_velocities[0]) - speed) / step
    print(f"{speed:g} rad/s: acceleration {found[speed]:.2f} rad/s^2, by the torque {3.0 / 0.35:.2f}")
right = all(abs(found[speed] - 3.0 / 0.35) < 0.1 for speed in (0.0, 20.0, 99.0))
sys.exit(0 if right and abs(found[101.0]) < 1e-6 and abs(found[1000.0]) < 1e-6 else 1)
CODE
