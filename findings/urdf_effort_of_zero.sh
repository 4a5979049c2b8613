#!/bin/sh
# <limit effort="0" velocity="0"> of a URDF, as exporters of CAD programs write for what nobody filled in, is a limit of zero to Pinocchio 4.1.0 (pin), no limit at all
# to MuJoCo 4.0.1, and to Drake 1.51.1 a joint without an actuator (a warning says so) that must not move faster than 0. Code that clips torques to the
# model's limits holds a limp arm in one of them and an unlimited one in the other.
# Seen: effort 5: 5 N m in all three; effort 0: 0 N m, not limited, no actuator; velocity 0: 0 in Pinocchio and Drake, MuJoCo has none.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "mujoco-core==4.0.1" "drake==1.51.1" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'CODE'
import sys

import mujoco
import pinocchio as pin
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

URDF = """<robot name="arm"><link name="base"/><link name="arm"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"
ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="{0}" velocity="{0}"/></joint><transmission name="drive"><type>transmission_interface/SimpleTransmission</type>
<joint name="hinge"><hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface></joint><actuator name="motor"/></transmission></robot>"""
told = {}
for limit in (5, 0):
    text, plant = URDF.format(limit), MultibodyPlant(0.0)
    ours, simulated = pin.buildModelFromXML(text), mujoco.MjModel.from_xml_string(text)
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.Finalize()
    drake = [plant.get_joint_actuator(each).effort_limit() for each in plant.GetJointActuatorIndices()]
    in_mujoco = float(simulated.jnt_actfrcrange[0, 1]) if simulated.jnt_actfrclimited[0] else None
    told[limit] = (float(ours.effortLimit[0]), in_mujoco, drake, float(ours.velocityLimit[0]), float(plant.GetVelocityUpperLimits()[-1]))
    print(f"effort and velocity {limit}: effort in pin {told[limit][0]}, mujoco {in_mujoco}, drake {drake}; velocity in pin, drake {told[limit][3:]}")
sys.exit(0 if told == {5: (5.0, 5.0, [5.0], 5.0, 5.0), 0: (0.0, None, [], 0.0, 0.0)} else 1)
CODE
