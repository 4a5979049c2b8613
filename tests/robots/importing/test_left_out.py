"""What an MJCF file says beside a description's content: it is read where there is a place, else named."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from aloft.robots.description import ReadRobot, read

from .model_files import INERTIAL, ONE_LEG

DEFAULTS = '<default><default class="foot"><geom friction="0.8 0.02 0.01" condim="6" solref="0.01 1"/></default></default>'
SAID = (
    ONE_LEG.replace("<worldbody>", DEFAULTS + '<option gravity="0 0 -1.6"/><worldbody>')
    .replace('<geom type="sphere" size=".035"', '<geom class="foot" type="sphere" size=".035"')
    .replace('range="0 120"', 'range="0 120" stiffness="7"')
    .replace('kp="100"', 'kp="100" kv="3" gear="2" armature="0.004" damping="0.05" timeconst="0.02"')
    .replace(
        "<actuator>",
        '<contact><exclude body1="torso" body2="shank"/></contact>'
        '<tendon><fixed name="rope"><joint joint="knee" coef="1"/></fixed></tendon>'
        '<actuator><motor name="winch" tendon="rope"/>',
    )
)  # fmt: skip


RARE = """<mujoco><option density="1.2" viscosity="0.1" wind="1 0 0"><flag gravity="disable"/></option><worldbody>
<body name="a" pos="0 0 1"><freejoint/><site name="s"/>
<geom name="g" size=".1" mass="1" gap="0.01" margin="0.02" adhesion="3" surfacevel="1 0 0"/>
<body name="b"><joint name="j" axis="0 1 0" range="-60 60" stiffness="0 20" springref="30"/><geom size=".1" pos="0 0 -.2" mass="1"/>
<body name="c"><joint name="k" axis="0 1 0" range="-60 60" stiffness="4"/><geom size=".1" pos="0 0 -.4" mass="1"/></body></body></body></worldbody>
<actuator><motor joint="j" name="m" delay="0.004" nsample="3" ctrlrange="-2 5"/><position name="p" joint="k" ctrlrange="0 1" forcerange="-3 9"/></actuator>
<sensor><gyro name="turn" site="s" delay="0.01" nsample="4" interval="0.005" cutoff="10"/><force name="push" site="s"/></sensor></mujoco>"""


TOLD_GAZEBO = f"""<robot name="legs">
<link name="trunk">{INERTIAL}</link>
<link name="leg">{INERTIAL}<contact><lateral_friction value="1.5"/><restitution value="0.5"/></contact></link>
<joint name="hip" type="revolute"><parent link="trunk"/><child link="leg"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="-9" velocity="9" acceleration="50"/>
<safety_controller soft_lower_limit="-0.5" soft_upper_limit="1" k_velocity="20"/></joint>
<gazebo reference="trunk"><mu1>0.80</mu1><mu2>0.6</mu2><kp value="1000000.0"/><minDepth>0.0</minDepth></gazebo>
<gazebo reference="leg"><turnGravityOff>true</turnGravityOff><material>Gazebo/Red</material></gazebo>
<gazebo reference="hip"><springStiffness>7</springStiffness></gazebo>
<gazebo><plugin filename="x.so"/><joint name="rod"><parent>trunk</parent><child>leg</child></joint></gazebo>
<transmission name="wrist"><joint name="a"/><joint name="b"/><actuator name="c"/></transmission></robot>"""


def read_text(folder: Path, text: str, name: str = "robot.xml") -> ReadRobot:
    path = folder / name
    path.write_text(text)
    return read(path)


def test_a_file_that_says_nothing_more_is_told_of_nothing(tmp_path: Path) -> None:
    notes = [note for note in read_text(tmp_path, ONE_LEG).notes if note.startswith("left out")]
    assert len(notes) == 1
    assert notes[0].startswith("left out: gains of servos, kp 100, kv 0 (knee) at the joint;")


@pytest.mark.parametrize("said", [
    "friction coefficient 0.8 (foot); friction is the ground's, robot.ground.friction",
    "torsional and rolling friction 0.02 0.01 (foot) and condim 6 (foot)",
    "solref 0.01 1 (foot); robot.ground.soles",
    "springs of joints, stiffness 7 (knee)",
    "gains of servos, kp 400, kv 12 (knee)",
    "activation dynamics of the actuators on knee",
    "actuators winch, which drive no single joint",
    "tendons rope",
    "that torso and shank do not touch",
    "a gravity of 0 0 -1.6 m/s^2",
])  # fmt: skip
def test_what_has_no_place_is_named(said: str, tmp_path: Path) -> None:
    assert any(said in note for note in read_text(tmp_path, SAID).notes)


@pytest.mark.parametrize("said", [
    "left out: contact gap 0.01 (a); contacts begin where shapes touch",
    "left out: contact margin 0.02 (a)",
    "left out: adhesion 3 (a); contacts here only push",
    "left out: surface velocity 1 0 0 0 0 0 (a)",
    "left out: springs of joints, stiffness 0 20 about 0.523599 (j); 4 (k) N m/rad; joints here have none",
    "left out: that torques differ by direction, -2 to 5 (j), -3 to 9 (k); the larger counts for both here",
    "left out: delay of actuators, 0.004 s (m); robot.latency in a graph or trial delays commands",
    "left out: nsample of actuators, 3 (m)",
    "left out: delay of sensors, 0.01 s (turn); noise of a sensor",
    "left out: interval of sensors, 0.005 s (turn)",
    "left out: cutoff of sensors, 10 (turn)",
    "left out: nsample of sensors, 4 (turn)",
    "sensors push have the other sign here: MuJoCo gives what the carrying link does to the sensor's, force_torque what",
    "left out: that gravity is off; gravity is 9.81 m/s^2 downwards",
    "left out: a medium of density 1.2 kg/m^3 and viscosity 0.1 Pa s, wind 1 0 0 m/s; nothing drags links here",
])  # fmt: skip
def test_what_few_files_say_is_named(said: str, tmp_path: Path) -> None:
    notes = read_text(tmp_path, RARE).notes
    assert any(said in note for note in notes), notes


def test_the_force_that_mujoco_measures_has_the_other_sign() -> None:
    import mujoco

    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="1 1 1"/>
      <body pos="0 0 0.3"><freejoint/><geom type="box" size=".1 .1 .1" mass="5" contype="0" conaffinity="0"/>
      <body pos="0 0 -.2"><joint axis="0 0 1"/><geom type="box" size=".2 .2 .1" mass="1"/><site name="s"/></body></body>
      </worldbody><sensor><force site="s"/></sensor></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    assert data.sensordata[2] == pytest.approx(-5.0 * 9.81, rel=1e-3)


def test_rotor_and_damping_of_an_actuator_are_those_behind_its_gear(tmp_path: Path) -> None:
    motors = read_text(tmp_path, SAID).description.motors
    assert motors.rotor_inertia.tolist() == pytest.approx([0.01, 0.004 * 4.0])
    assert motors.damping.tolist() == pytest.approx([0.0, 0.05 * 4.0])
    assert motors.peak_torque[1] == pytest.approx(80.0)


def test_the_range_of_a_velocity_servo_is_a_speed_limit(tmp_path: Path) -> None:
    servo = '<velocity joint="hip" kv="5" gear="2" ctrlrange="-30 24" forcerange="-9 9"/>'
    text = ONE_LEG.replace('<motor joint="hip" gear="50" ctrlrange="-1 1"/>', servo)
    motors = read_text(tmp_path, text).description.motors
    assert motors.no_load_speed[0] == pytest.approx(15.0)
    assert motors.no_load_speed[1] != pytest.approx(15.0)


def test_a_joint_that_an_equality_ties_is_fixed(tmp_path: Path) -> None:
    tie = '<equality><joint joint1="knee" joint2="hip" polycoef="0 2 0 0 0"/></equality><actuator>'
    text = ONE_LEG.replace("<actuator>", tie)
    found = read_text(tmp_path, text)
    assert [joint.name for joint in found.description.joints] == ["hip"]
    assert "joint knee follows hip in the file and is fixed at 0.749066 here" in found.notes
    inactive = read_text(tmp_path, text.replace("<joint joint1", '<joint active="false" joint1'))
    assert len(inactive.description.joints) == 2
    assert math.isfinite(found.description.total_mass)


@pytest.mark.parametrize("said", [
    "left out: friction coefficient 1.5 (leg); mu1 0.8, mu2 0.6 (trunk); friction is the ground's, robot.ground.friction",
    "left out: softness of contacts, kp 1e+06 (trunk); robot.ground.soles",
    "left out: restitution 0.5 (leg)",
    "left out: springs of joints, springStiffness 7 (hip)",
    "left out: limits of joints' acceleration 50 (hip); motors here have torque and speed",
    "left out: soft limits -0.5 to 1 (hip); those of <limit> hold",
    "left out: leg without weight; gravity",
    "left out: joints rod, which close loops for Gazebo",
    "left out: transmissions wrist, which couple joints",
    "joint hip has a negative effort limit in the URDF, -9: it counts as none",
])  # fmt: skip
def test_what_a_urdf_tells_simulators_is_named(said: str, tmp_path: Path) -> None:
    assert any(said in note for note in read_text(tmp_path, TOLD_GAZEBO, "robot.urdf").notes)


def test_what_only_says_how_a_simulator_runs_is_not(tmp_path: Path) -> None:
    notes = read_text(tmp_path, TOLD_GAZEBO, "robot.urdf").notes
    assert len([note for note in notes if note.startswith("left out")]) == 9
