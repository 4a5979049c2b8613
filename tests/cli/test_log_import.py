"""What `aloft log import` guesses from names and widths, and the graph that it writes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
import yaml

from aloft import load
from aloft.cli.log_import import forces_of_feet, graph_of, guess, import_log, numbered
from aloft.cli.logged_joints import columns_of_joints
from aloft.hal.log.log_file import read_log
from aloft.lab.studies.icub_estimators import JOINTS, write_robot
from aloft.robots.description import find_robot
from aloft.robots.robot_description import Foot
from aloft.runtime.loading import LoadError, checked_file

from ..shared_data import FOLDER, needs_icub
from ..stepping import BRUCE, NAMES, PERIOD, shuffled, stepping
from .conftest import outcome, run_for_json

PENDULUM = [
    "time", "pos_meas1", "pos_meas2", "pos_filt1", "pos_filt2", "pos_des1", "pos_des2",
    "tau_des1", "tau_des2", "tau_fric1", "tau_fric2", "tau_meas1", "tau_meas2",
]  # fmt: skip


def test_numbered_columns_are_one_quantity_and_the_measured_one_is_taken() -> None:
    guessed = guess(dict.fromkeys(PENDULUM, 1), joints=[2])
    assert guessed == {
        "time": "time",
        "joint_position": ["pos_meas1", "pos_meas2"],
        "joint_torque": ["tau_meas1", "tau_meas2"],
    }
    assert "joint_position" not in guess(dict.fromkeys(PENDULUM, 1), joints=[3]), "two are no three"
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


def imported(
    file: Path, robot: Path | str, out: Path, *options: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what `aloft log import` says, and what the graph plays."""
    said = run_for_json(
        "log", "import", str(file), "--robot", str(robot), "--out", str(out), *options
    )
    return said, yaml.safe_load(out.read_text())["blocks"]["robot"]["with"]


@pytest.mark.long
@needs_icub
def test_an_icubs_log_gets_all_that_its_estimator_needs(tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    said, played = imported(
        FOLDER / "icub" / "walking.mat", write_robot(tmp_path), tmp_path / "walk.yaml"
    )
    assert said["guessed"]["force of l_sole"] == "lfForceZ"
    contacts = played["contacts"]
    assert {foot: each["force"] for foot, each in contacts.items()} == {
        "l_sole": "lfForceZ",
        "r_sole": "rfForceZ",
    }
    assert contacts["l_sole"]["closes"] == "81 N", "a quarter of the weight of 33.1 kg"
    assert played["joints"]["names"] == "estimatorJointsOrdering", "MATLAB's strings in the file"
    assert [each["joint"] for each in said["joints"]] == JOINTS
    assert {each["sure"] for each in said["joints"]} == {"named"}
    assert played["imu"]["sensor"] == "root_link_imu_acc", (
        "not at the base's origin, nor along its axes"
    )
    assert played["clock"] == {"stamps": "estimatorJointsTime", "even": True}
    assert any("the feet stand still with these names" in note for note in said["notes"])
    assert any("arrival times" in note for note in said["notes"])
    result = load(tmp_path / "walk.yaml").run(log=False, run_hash=False)
    result.raise_if_failed()
    assert result.metrics["estimator_position_rms_m"] < 0.02, "nothing was written by hand"


@pytest.mark.long
@needs_icub
@pytest.mark.parametrize("feet", ["balls", "soles"])
def test_soles_need_not_be_level_as_the_description_stands(tmp_path: Path, feet: str) -> None:
    """``aloft robot import`` guesses balls, on which the pose that it finds rolls."""
    pytest.importorskip("h5py")
    robot = write_robot(tmp_path)
    written = robot.read_text()
    if feet == "balls":
        written = re.sub(r"points: \[\[.*\]\]", "radius: 0.02", written)
        assert "points" not in written
    rolled = "r_hip_roll: 0.368, r_hip_yaw: 0.351, r_hip_pitch: 0.723, r_knee: -1.31, r_ankle_roll: -0.097"
    written, count = re.subn(r"(?m)^standing: .*$", f"standing: {{{rolled}}}", written)
    assert count == 1
    robot.write_text(written)
    said, played = imported(FOLDER / "icub" / "walking.mat", robot, tmp_path / "walk.yaml")
    assert any("the feet stand still with these names" in note for note in said["notes"])
    assert played["imu"]["sensor"] == "root_link_imu_acc"


@pytest.mark.long
@needs_icub
@pytest.mark.parametrize("log", ["walking", "com-sinusoid"])
def test_an_icubs_columns_without_names_are_told_by_its_feet_or_left_open(
    tmp_path: Path, log: str
) -> None:
    pytest.importorskip("h5py")
    arrays = read_log(FOLDER / "icub" / f"{log}.mat").arrays
    file, out, robot = tmp_path / "log.npz", tmp_path / "log.yaml", write_robot(tmp_path)
    np.savez(file, **{name: each.values for name, each in arrays.items()})
    said, played = imported(file, robot, out)
    names = played["joints"]["names"]
    assert names[:14] == ["?"] * 14, "no foot tells arms, torso and neck"
    assert names[14:] == JOINTS[14:], "both legs"
    sure = [each["sure"] for each in said["joints"]]
    assert set(sure[14:]) == {"told", "likely"} and set(sure[:14]) == {"open"}
    assert all(name in said["joints"][k]["why"] for k, name in enumerate(JOINTS[:14])), (
        "among what limits leave"
    )
    assert played["imu"]["sensor"] == "root_link_imu_acc"
    assert "- l_knee  # estimatorJointsPos[17]: " in out.read_text()
    with pytest.raises(LoadError) as caught:
        checked_file(out)
    text = str(caught.value)
    assert (
        "columns 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13 (the first is 0) have no joint's name yet"
        in text
    )
    assert (
        "as the driver's documentation has them" in text and "- for a column that is none" in text
    )
    known = ",".join(["-"] * 14 + JOINTS[14:])
    again, played = imported(file, robot, out, "--joints", known, "--force")
    assert {each["sure"] for each in again["joints"]} == {"given"}
    checked_file(out)
    crossed = (
        known.replace("l_knee", "x").replace("l_hip_pitch", "l_knee").replace("x", "l_hip_pitch")
    )
    again, _ = imported(file, robot, out, "--joints", crossed, "--force")
    assert any("look at the names of the legs' joints" in note for note in again["notes"]) == (
        log == "walking"
    )


def standing_log(file: Path, order: np.ndarray, **more: Any) -> None:
    """Write a log of BRUCE on one foot, then on the other, its columns in an order, and ``more`` arrays."""
    motion = shuffled(stepping(2), order)
    time = PERIOD * np.arange(len(motion.position))
    force = dict(zip((foot.name for foot in BRUCE.feet), 60.0 * motion.closed.T, strict=True))
    np.savez(
        file, time=time, joint_position=motion.position, joint_velocity=motion.velocity, gyro=motion.rate,
        specific_force=9.81 * motion.up, left_force_z=force["left_foot"], right_force_z=force["right_foot"], **more,
    )  # fmt: skip


def test_shuffled_columns_of_a_log_get_their_joints(tmp_path: Path) -> None:
    order = np.random.default_rng(2).permutation(len(NAMES))
    standing_log(tmp_path / "log.npz", order)
    said, played = imported(tmp_path / "log.npz", "bruce", tmp_path / "log.yaml")
    names = played["joints"]["names"]
    assert all(name in (NAMES[k], "?") for name, k in zip(names, order, strict=True))
    assert names.count("?") <= 4, "hip and ankle of one leg, exchanged, move the base nearly alike"
    assert [each["sure"] for each in said["joints"]] == [
        "open" if name == "?" else "told" for name in names
    ]
    assert any("--joints NAME,NAME,..." in note for note in said["notes"]) == ("?" in names)


def test_columns_of_another_unit_or_length_are_no_obstacle(tmp_path: Path) -> None:
    head = "time [s]," + ",".join(f"q{k} [m]" for k in range(1, 11)) + "\n"
    rows = "".join(f"{0.01 * k}," + ",".join(["0.1"] * 10) + "\n" for k in range(50))
    (tmp_path / "log.csv").write_text(head + rows)
    said, played = imported(tmp_path / "log.csv", "bruce", tmp_path / "log.yaml")
    assert played["joints"]["position"] == [f"q{k}" for k in range(1, 11)]
    assert {each["sure"] for each in said["joints"]} <= {"assumed", "open"}
    assert any("no contacts of feet were found" in note for note in said["notes"])
    standing_log(tmp_path / "log.npz", np.arange(len(NAMES)))
    arrays = dict(np.load(tmp_path / "log.npz"))
    arrays["joint_velocity"] = arrays["joint_velocity"][::2]
    np.savez(tmp_path / "log.npz", **arrays)
    said, _ = imported(tmp_path / "log.npz", "bruce", tmp_path / "half.yaml")
    assert not any(
        each["joint"] not in (None, name) for each, name in zip(said["joints"], NAMES, strict=True)
    )


@pytest.mark.parametrize("right", [True, False])
def test_names_in_the_file_are_taken_and_held_against_the_feet(tmp_path: Path, right: bool) -> None:
    order = np.random.default_rng(2).permutation(len(NAMES))
    names = [NAMES[k] for k in order] if right else NAMES
    standing_log(tmp_path / "log.npz", order, listed=np.array(names), other=np.array(["a", "b"]))
    said, played = imported(tmp_path / "log.npz", "bruce", tmp_path / "log.yaml")
    assert played["joints"]["names"] == "listed"
    assert [(each["joint"], each["sure"]) for each in said["joints"]] == [
        (n, "named") for n in names
    ]
    still = any("the feet stand still with these names" in note for note in said["notes"])
    wrong = any("look at the names of the legs' joints" in note for note in said["notes"])
    assert (still, wrong) == (right, not right), said["notes"]


@pytest.mark.parametrize(
    ("given", "error"),
    [
        (",".join(NAMES[:-1]), "--joints has 9 names, expected 10: one for each column from joint_position[0] to joint_position[9]"),
        (",".join(["left_kneee", *NAMES[1:]]), "the robot has no joint left_kneee; did you mean left_knee?"),
    ],
)  # fmt: skip
def test_names_that_cannot_be_are_refused(tmp_path: Path, given: str, error: str) -> None:
    standing_log(tmp_path / "log.npz", np.arange(len(NAMES)))
    done = outcome(
        "log", "import", str(tmp_path / "log.npz"), "--robot", "bruce", "--joints", given
    )
    assert done.returncode == 2 and error in " ".join((done.stdout + done.stderr).split())


def test_columns_that_are_called_by_joints() -> None:
    widths = dict.fromkeys(
        [
            "t",
            "left_knee_pos",
            "left_knee_vel",
            "right_knee.position",
            "right_knee.velocity",
            "left_knee_tau",
        ],
        1,
    )
    assert columns_of_joints(widths, find_robot("bruce")) == {
        "names": ["right_knee", "left_knee"],
        "position": ["right_knee.position", "left_knee_pos"],
        "velocity": ["right_knee.velocity", "left_knee_vel"],
    }, "a torque of one of two is none"
    assert not columns_of_joints({"left_knee_temperature": 1, "knee": 1}, find_robot("bruce"))


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


def test_a_robot_that_is_not_there_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "log.csv").write_text("t,q\n0,1\n1,2\n")
    with pytest.raises(typer.Exit):
        import_log(tmp_path / "log.csv", tmp_path / "robot.yaml", tmp_path / "graph.yaml")
    said = " ".join(capsys.readouterr().err.split())
    assert "error: --robot" in said and "no robot description at" in said
    assert not (tmp_path / "graph.yaml").exists()
