#!/bin/sh
# Drake 1.51.1 (pydrake): `CalcNonConservativePower` of a MultibodyPlant counts force elements only. A motor, the damping of a joint, an applied force or torque do work without it: the balance d/dt (kinetic +
# potential energy) = non-conservative power, which it is for, does not hold, and a cost of transport or an energy shaping law from it is zero. Conservative power and the energies are right.
# A damper that is a force element (LinearSpringDamper) is counted.
# Expected: torque x speed - damping x speed^2, as central differences of the energies along the motion say.
# Seen, a pendulum at 2 rad/s: motor of 3 N m 6 W, damping of 0.5 N m s/rad -2 W, applied torque of 1.5 N m 3 W: the energy changes so, each is 0 W in Drake; a damper element -2 W, Drake -2 W.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check drake==1.51.1 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import LinearSpringDamper, RevoluteJoint, RotationalInertia, SpatialInertia

STATE, SMALL = np.array([0.5, 2.0]), 1e-6


def powers(damping=0.0, motor=0.0, applied=0.0, damper=0.0):
    """The rate of the total energy by central differences, and what Drake says, both in watts."""
    plant = MultibodyPlant(0.0)
    link = plant.AddRigidBody("link", SpatialInertia.MakeFromCentralInertia(1.0, [0, 0, -0.5], RotationalInertia(0.1, 0.1, 0.1)))
    joint = plant.AddJoint(RevoluteJoint("joint", plant.world_frame(), link.body_frame(), [0, 1, 0], damping=damping))
    plant.AddJointActuator("motor", joint)
    if damper:
        plant.AddForceElement(LinearSpringDamper(plant.world_body(), [1, 0, 0], link, [0, 0, -1], 1.0, 0.0, damper))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.get_actuation_input_port().FixValue(context, [motor])
    plant.get_applied_generalized_force_input_port().FixValue(context, [applied])

    def energy(state):
        plant.SetPositionsAndVelocities(context, state)
        return plant.CalcKineticEnergy(context) + plant.CalcPotentialEnergy(context)

    plant.SetPositionsAndVelocities(context, STATE)
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    rate = (energy(STATE + SMALL * rates) - energy(STATE - SMALL * rates)) / (2 * SMALL)
    plant.SetPositionsAndVelocities(context, STATE)
    return rate, plant.CalcNonConservativePower(context)


speed, angle = STATE[1], STATE[0]
hung = np.array([-np.sin(angle), -np.cos(angle)])  # the end of the link, x and z
along = (hung - [1, 0]) / np.linalg.norm(hung - [1, 0])
stretch = speed * along @ np.array([-np.cos(angle), np.sin(angle)])
cases = {
    "a motor of 3 N m": ({"motor": 3.0}, 3 * speed, True),
    "joint damping of 0.5 N m s/rad": ({"damping": 0.5}, -0.5 * speed**2, True),
    "an applied torque of 1.5 N m": ({"applied": 1.5}, 1.5 * speed, True),
    "a damper element of 0.8 N s/m": ({"damper": 0.8}, -0.8 * stretch**2, False),
    "nothing": ({}, 0.0, False),
}
right, lost = True, True
for name, (settings, wanted, forgotten) in cases.items():
    rate, told = powers(**settings)
    print(f"Drake 1.51.1, {name}: the energy changes by {rate:.4f} W (by hand {wanted:.4f} W), CalcNonConservativePower {told:.4f} W")
    right = right and abs(rate - wanted) < 1e-5 and (forgotten or abs(told - wanted) < 1e-5)
    lost = lost and (not forgotten or told == 0)
sys.exit(0 if right and lost else 1)
CODE
