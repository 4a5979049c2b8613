#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): an actuator with `site` and `refsite` on two bodies neither of which carries the other is not the gradient of its length. The length is the site's place in the
# frame of the refsite, the moment leaves out that this frame turns: the pull at one site and its answer at the other are equal and opposite but not on one line. So a servo between
# two floating bodies (a docking, two arms on one object) makes angular momentum out of nothing, feeds energy in, and `actuator_velocity` is not the rate of `actuator_length`.
# Expected, and seen with a tendon between the same sites: the angular momentum stays zero, the energy (with 0.5 kp error^2) constant, the velocity the rate of the length.
# Seen with position servos of 20 N/m along the three axes of the refsite, 2 s from rest: 2.8 kg m^2/s, the energy grows from 1.6 to 51 J, the velocity is off by up to 19 m/s.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" mujoco-core==4.0.1 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import mujoco
import numpy as np

WORLD = """<mujoco><option gravity="0 0 0" integrator="RK4" timestep="5e-4"/><worldbody>
  <body pos="0 0 0"><freejoint/><geom type="box" size=".1 .2 .3" mass="2"/><site name="one" pos=".05 .1 0"/></body>
  <body pos=".5 .3 0"><freejoint/><geom type="box" size=".1 .05 .1" mass="1"/><site name="two"/></body></worldbody>
  <tendon><spatial name="rope"><site site="one"/><site site="two"/></spatial></tendon><actuator>{}</actuator></mujoco>"""
SERVO = '<position site="two" refsite="one" gear="{} 0 0 0" kp="20"/>'
CASES = {
    "refsite": ("".join(SERVO.format(axis) for axis in ("1 0 0", "0 1 0", "0 0 1")), [0.8, 0, 0]),
    "tendon": ('<position tendon="rope" kp="20"/>', [0.8]),
}


def sums(model, data):
    """The total momentum, angular momentum about the origin and kinetic energy, from velocities and inertias."""
    linear, angular, energy = np.zeros(3), np.zeros(3), 0.0
    for body in (1, 2):
        speed, turn = np.zeros(6), data.ximat[body].reshape(3, 3)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, speed, 0)
        mass, inertia = model.body_mass[body], turn @ np.diag(model.body_inertia[body]) @ turn.T
        linear += mass * speed[3:]
        angular += mass * np.cross(data.xipos[body], speed[3:]) + inertia @ speed[:3]
        energy += 0.5 * mass * speed[3:] @ speed[3:] + 0.5 * speed[:3] @ inertia @ speed[:3]
    return linear, angular, energy


def flight(actuators, target):
    model = mujoco.MjModel.from_xml_string(WORLD.format(actuators))
    data, nudged, seen = mujoco.MjData(model), mujoco.MjData(model), []
    data.ctrl[:] = target
    for tick in range(4000):
        if tick % 20 == 0:
            mujoco.mj_forward(model, data)
            lengths = []
            for way in (1e-6, -1e-6):
                nudged.qpos[:] = data.qpos
                mujoco.mj_integratePos(model, nudged.qpos, data.qvel, way)
                mujoco.mj_forward(model, nudged)
                lengths.append(nudged.actuator_length.copy())
            linear, angular, energy = sums(model, data)
            total = energy + 10 * np.sum((data.actuator_length - target) ** 2)
            rate = np.abs(data.actuator_velocity - (lengths[0] - lengths[1]) / 2e-6).max()
            seen.append([np.abs(linear).max(), np.abs(angular).max(), total, rate])
        mujoco.mj_step(model, data)
    momentum, turn, energy, rate = np.array(seen).T
    return momentum.max(), turn.max(), energy[0], energy.min(), energy.max(), rate.max()


told = {name: flight(actuators, np.array(target)) for name, (actuators, target) in CASES.items()}
for name, (momentum, turn, start, least, most, rate) in told.items():
    print(f"MuJoCo {mujoco.__version__}, {name}: momentum {momentum:.1e} kg m/s, angular momentum {turn:.3g} kg m^2/s, energy {start:.4f} J, then {least:.4f} to {most:.4f} J,")
    print(f"  velocity less the rate of the length {rate:.2g} m/s")
site, rope = told["refsite"], told["tendon"]
exact = max(rope[0], rope[1], rope[4] - rope[3], rope[5]) < 1e-4
sys.exit(0 if exact and site[0] < 1e-6 and site[1] > 0.1 and site[4] - site[3] > 0.1 and site[5] > 0.1 else 1)
CODE
