"""What `aloft log import` guesses from names and widths, and the graph that it writes."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from aloft.cli.log_import import forces_of_feet, graph_of, guess, numbered
from aloft.lab.studies.icub_estimators import write_robot
from aloft.robots.description import find_robot
from aloft.robots.robot_description import Foot
from aloft.runtime.loading import LoadError, checked_file

from ..shared_data import FOLDER, needs_icub
from .conftest import run_for_json

PENDULUM = [
    "time", "pos_meas1", "pos_meas2", "pos_filt1", "pos_filt2", "pos_des1", "pos_des2",
    "tau_des1", "tau_des2", "tau_fric1", "tau_fric2", "tau_meas1", "tau_meas2",
]  # fmt: skip


def test_numbered_columns_are_one_quantity_and_the_measured_one_is_taken() -> None:
    guessed = guess(dict.fromkeys(PENDULUM, 1), joints=2)
    assert guessed == {
        "time": "time",
        "joint_position": ["pos_meas1", "pos_meas2"],
        "joint_torque": ["tau_meas1", "tau_meas2"],
    }
    assert "joint_position" not in guess(dict.fromkeys(PENDULUM, 1), joints=3), "two are no three"
    graph = graph_of(Path("log.csv"), None, guessed, own_stamps=False)
    assert list(graph["blocks"]) == ["robot"], "without an IMU no base is estimated"
    joints = graph["blocks"]["robot"]["with"]["joints"]
    assert joints == {"position": ["pos_meas1", "pos_meas2"], "torque": ["tau_meas1", "tau_meas2"]}


def test_measured_columns_come_before_wanted_ones_whatever_their_order() -> None:
    widths = {
        "q_des": 12,
        "effort_cmd": 12,
        "joint_position_target": 12,
        "joint_position": 12,
        "effort": 12,
    }
    guessed = guess(widths)
    assert (guessed["joint_position"], guessed["joint_torque"]) == ("joint_position", "effort")


@pytest.mark.parametrize(
    ("names", "series"),
    [
        (["q[0]", "q[1]", "q[2]"], {"q": ["q[0]", "q[1]", "q[2]"]}),
        (["q_2", "q_1", "q_10", "q_3"], {}),  # one is missing
        (["acc2", "acc3"], {}),  # they begin neither with 0 nor with 1
        (["q1 [deg]", "q2 [deg]"], {"q [deg]": ["q1 [deg]", "q2 [deg]"]}),
        (["q", "q0", "q1"], {}),  # the name is taken
    ],
)
def test_columns_that_count_up(names: list[str], series: dict[str, list[str]]) -> None:
    assert numbered(dict.fromkeys(names, 1)) == series


@pytest.mark.parametrize(
    ("columns", "feet", "found"),
    [
        (["lfForceZ", "rfForceZ", "lfPos"], ["r_sole", "l_sole"], {"l_sole": "lfForceZ", "r_sole": "rfForceZ"}),
        (["left_foot_fz", "left_foot_fx"], ["left_foot", "right_foot"], {"left_foot": "left_foot_fz"}),
        (["lfForceZ"], ["l_foot_front", "l_foot_rear"], {}),  # which of both is not known
        (["lfForceZ", "leftForce"], ["l_sole"], {}),
        (["force", "reforce"], ["l_sole", "r_sole"], {}),  # of no side
    ],
)  # fmt: skip
def test_forces_go_to_the_foot_of_their_side(
    columns: list[str], feet: list[str], found: dict[str, str]
) -> None:
    robot = find_robot("bruce")
    robot = robot.changed(feet=tuple(Foot(name=f, link=robot.base, sole=(0, 0, 0)) for f in feet))
    assert forces_of_feet(dict.fromkeys(columns, 1), robot) == found
    assert not forces_of_feet(dict.fromkeys(columns, 3), robot), "a vector is no normal force"


@needs_icub
def test_an_icubs_log_gets_its_contacts(tmp_path: Path) -> None:
    robot, out = write_robot(tmp_path), tmp_path / "walk.yaml"
    done = run_for_json(
        "log",
        "import",
        str(FOLDER / "icub" / "walking.mat"),
        "--robot",
        str(robot),
        "--out",
        str(out),
    )
    assert done["guessed"]["force of l_sole"] == "lfForceZ"
    graph = yaml.safe_load(out.read_text())
    contacts = graph["blocks"]["robot"]["with"]["contacts"]
    assert {foot: each["force"] for foot, each in contacts.items()} == {
        "l_sole": "lfForceZ",
        "r_sole": "rfForceZ",
    }
    assert contacts["l_sole"]["closes"] == "81 N", "a quarter of the weight of 33.1 kg"


STICK = """<mujoco><worldbody><body name="rod"><joint name="hinge" axis="0 1 0" range="-1 1"/>
<geom type="capsule" fromto="0 0 0 0 0 -.5" size=".02" mass="1"/></body></worldbody>
<actuator><motor joint="hinge" ctrlrange="-5 5"/></actuator></mujoco>"""


def test_a_selection_of_a_signal_without_elements_is_named(tmp_path: Path) -> None:
    (tmp_path / "stick.xml").write_text(STICK)
    file = tmp_path / "graph.yaml"
    file.write_text("""\
rate: 100 Hz
robot: stick.xml
blocks:
  robot: {use: hal.MujocoRobot}
  any: {use: blocks.Not, in: {u: "robot.contacts.closed[0]"}}
""")
    with pytest.raises(LoadError) as caught:
        checked_file(file)
    messages = [problem.message for problem in caught.value.report.problems]
    assert "robot.contacts.closed[0] has no elements with this robot" in messages
