#!/bin/sh
# jaxsim 0.9.0: `potential_energy` has the wrong sign: it is mass x height x model.gravity, and model.gravity is -9.81. A link that is lifted loses potential energy, and `mechanical_energy`, which adds
# it to the kinetic energy, swings by twice what is exchanged, though the motion is right. Who checks an integrator, or shapes a swing-up or a reward by the energy, drives the robot the other way.
# Seen: a pendulum let go at 1 rad: mechanical energy 2.65, 7.0 and 3.1 J at 0, 0.4 and 0.8 s; kinetic less potential energy is the same to 0.003 J.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check jaxsim==0.9.0 rod==0.5.0 jax==0.10.2 jaxlib==0.10.2 numpy==2.4.6
cat > "$folder/pendulum.sdf" <<'SDF'
<sdf version="1.7"><model name="pendulum">
<link name="base"><inertial><mass>1</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<link name="bob"><pose relative_to="hinge">0 0 0 0 0 0</pose><inertial><pose>0 0 -0.5 0 0 0</pose><mass>1</mass>
<inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>
<joint name="fixed" type="fixed"><parent>world</parent><child>base</child></joint>
<joint name="hinge" type="revolute"><pose relative_to="base">0 0 0 0 0 0</pose><parent>base</parent><child>bob</child>
<axis><xyz>0 1 0</xyz><limit><lower>-3</lower><upper>3</upper></limit></axis></joint>
</model></sdf>
SDF
JAX_PLATFORMS=cpu JAX_ENABLE_X64=1 "$folder/env/bin/python" -W ignore - "$folder/pendulum.sdf" <<'CODE'
import pathlib
import sys

import jax
import jax.numpy as jnp
import jaxsim.api as js
import numpy as np

model = js.model.JaxSimModel.build_from_model_description(pathlib.Path(sys.argv[1]).read_text(), time_step=1e-3)
start = js.data.JaxSimModelData.build(model, joint_positions=jnp.array([1.0]), joint_velocities=jnp.zeros(1))


def step(data, _):
    energies = js.model.kinetic_energy(model, data), js.model.potential_energy(model, data), js.model.mechanical_energy(model, data)
    return js.model.step(model, data), jnp.array([data.joint_positions[0], *energies])


angle, kinetic, potential, mechanical = np.array(jax.jit(lambda data: jax.lax.scan(step, data, None, length=801)[1])(start)).T
for time in (0, 400, 800):
    height = -0.5 * np.cos(angle[time])
    print(f"{time / 1000} s: height {height:.3f} m, m g h {9.81 * height:.2f} J; jaxsim: kinetic {kinetic[time]:.2f}, potential {potential[time]:.2f}, mechanical {mechanical[time]:.2f} J; kinetic - potential {kinetic[time] - potential[time]:.3f} J")
upside_down = np.allclose(potential, 9.81 * 0.5 * np.cos(angle), atol=1e-6)
sys.exit(0 if upside_down and np.ptp(mechanical) > 4.0 and np.ptp(kinetic - potential) < 0.02 else 1)
CODE
