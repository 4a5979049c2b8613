#!/bin/sh
# jaxsim 0.9.0: the <dissipation> of a joint's limit (SDF) brakes at the lower limit and drives at the upper one. The damper is the limit's spring torque times dissipation times speed, and the
# torque is negative at the upper limit, so the damper is, too: a joint that runs into its upper limit leaves it faster, and with enough of it does not come back.
# Seen: a hinge of 0.35 kg m^2 at 1 rad/s into limits of +-1 rad, stiffness 1000 N m/rad, no gravity. Lower limit: leaves at 1.00, 0.75 and 0.20 rad/s for dissipation 0, 0.5 and 5.
# Upper limit: 1.00, 1.51 rad/s, and with 5 it breaks through and runs away at 100 rad/s.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check jaxsim==0.9.0 rod==0.5.0 jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6
cat > "$folder/hinge.sdf" <<'SDF'
<sdf version="1.7"><model name="arm">
<link name="base"><inertial><mass>1</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<link name="arm"><pose relative_to="hinge">0 0 0 0 0 0</pose><inertial><pose>0 0 -0.5 0 0 0</pose><mass>1</mass>
<inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<joint name="fixed" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="hinge" type="revolute"><pose relative_to="base">0 0 0 0 0 0</pose><parent>base</parent><child>arm</child>
<axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper><stiffness>1000</stiffness><dissipation>DISSIPATION</dissipation></limit></axis></joint>
</model></sdf>
SDF
JAX_PLATFORMS=cpu JAX_ENABLE_X64=1 "$folder/env/bin/python" -W ignore - "$folder/hinge.sdf" <<'CODE'
import pathlib
import sys

import jax
import jax.numpy as jnp
import jaxsim.api as js
import numpy as np

text, fastest, last = pathlib.Path(sys.argv[1]).read_text(), {}, {}
for dissipation in ("0", "0.5", "5"):
    model = js.model.JaxSimModel.build_from_model_description(text.replace("DISSIPATION", dissipation), time_step=1e-3, gravity=0.0)
    run = jax.jit(lambda data: jax.lax.scan(lambda data, _: (js.model.step(model, data), data.joint_velocities[0]), data, None, length=1200)[1])
    for side, sign in (("lower", -1.0), ("upper", 1.0)):
        speeds = np.array(run(js.data.JaxSimModelData.build(model, joint_positions=jnp.zeros(1), joint_velocities=jnp.array([sign]))))
        fastest[side, dissipation], last[side, dissipation] = np.abs(speeds).max(), abs(speeds[-1])
    print(f"dissipation {dissipation}: into the limit at 1 rad/s; 1.2 s later: " + ", ".join(f"{side} {last[side, dissipation]:.2f} rad/s (at most {fastest[side, dissipation]:.2f})" for side in ("lower", "upper")))
good = abs(last["upper", "0"] - 1) < 0.01 and last["lower", "0.5"] < 0.8 and last["lower", "5"] < 0.3 and max(fastest["lower", "0.5"], fastest["lower", "5"]) < 1.01
sys.exit(0 if good and last["upper", "0.5"] > 1.3 and fastest["upper", "5"] > 5 else 1)
CODE
