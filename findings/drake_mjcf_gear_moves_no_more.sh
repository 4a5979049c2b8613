#!/bin/sh
# Drake 1.51.1 (pydrake): the `gear` of a `motor` of an MJCF file is read, and no torque is multiplied by it. MuJoCo gives the joint gear times the control. Drake gives the control alone (it keeps the
# number as the gear ratio of a rotor, where it only says how much of the inertia is whose), also where gear is -1, the way MJCF turns a motor round: there the joint goes the other way.
# The limit of the motor (`forcerange`, in MuJoCo before the gear) becomes that of the joint. A joint's `armature` counts if a motor drives it, and is forgotten if none does. For none of these is there
# a warning, though Drake warns of an attribute that it does not read (`frictionloss` below).
# Expected, as MuJoCo 4.0.1 and by hand, gear x control / (inertia + armature), 1 N m on 0.11 kg m^2: gear 1: 9.09 rad/s^2; 50: 455; -1: -9.09; without a motor 1 N m / 0.11 kg m^2 as well.
# Seen in Drake: gear 1: 9.09; 50: 9.09; -1: +9.09; with forcerange -1 to 1, gear 50 and 5 N m: 9.09 for 455; without a motor 10.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check drake==1.51.1 mujoco-core==4.0.1 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import logging
import sys

import mujoco
import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

TEXT = """<mujoco model="arm"><option gravity="0 0 0"/><worldbody><body name="link"><joint name="joint" type="hinge" axis="0 1 0" armature="0.01" {joint}/>
  <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body></worldbody><actuator>{motor}</actuator></mujoco>"""
MOTOR = '<motor name="motor" joint="joint" {}/>'
CASES = {
    "gear 1": (MOTOR.format('gear="1"'), 1.0, 1.0),
    "gear 50": (MOTOR.format('gear="50"'), 1.0, 50.0),
    "gear -1": (MOTOR.format('gear="-1"'), 1.0, -1.0),
    "gear 50, forcerange -1 to 1, 5 N m asked": (MOTOR.format('gear="50" forcerange="-1 1"'), 5.0, 50.0),
    "no motor, 1 N m applied": ("", 1.0, 1.0),
}
said = []


class Listen(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())


log = logging.getLogger("drake")
log.handlers, log.propagate = [Listen()], False


def by_mujoco(text, torque):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    (data.ctrl if model.nu else data.qfrc_applied)[0] = torque
    mujoco.mj_forward(model, data)
    return float(data.qacc[0])


def by_drake(text, torque):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "xml")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    if plant.num_actuators():
        plant.get_actuation_input_port().FixValue(context, [torque])
    else:
        plant.get_applied_generalized_force_input_port().FixValue(context, [torque])
    return float(plant.get_generalized_acceleration_output_port().Eval(context)[0])


found = {}
for name, (motor, torque, wanted) in CASES.items():
    text = TEXT.format(joint="", motor=motor)
    found[name] = by_mujoco(text, torque), by_drake(text, torque), wanted / 0.11
    print(f"{name}: MuJoCo {found[name][0]:.4g}, Drake {found[name][1]:.4g}, by hand {found[name][2]:.4g} rad/s^2")
quiet = not said
by_drake(TEXT.format(joint='frictionloss="1"', motor=""), 1.0)
print(f"Drake's warnings of all these: {'none' if quiet else said}; of frictionloss: {len(said)}")
right = all(abs(theirs - hand) < 1e-6 * abs(hand) for theirs, _, hand in found.values())
seen = [drake for _, drake, _ in found.values()]
sys.exit(0 if right and quiet and said and np.allclose(seen, (1 / 0.11,) * 4 + (10.0,), rtol=1e-6) else 1)
CODE
