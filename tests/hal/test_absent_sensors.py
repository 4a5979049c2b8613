"""A robot without feet, IMU or switches runs and is recorded; wires from what it lacks are errors."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

import aloft
from aloft.logs.file.reader import read

GRAPH = """\
rate: 500 Hz
duration: 0.1 s
robot: robot.yaml
blocks:
  robot: {use: hal.MujocoRobot, in: {command: {value: {mode: 2}}}}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    still = [0.01, 0.01, 0.01, 0, 0, 0]
    link: dict[str, Any] = {"mass": 1.0, "com": [0, 0, 0.1], "inertia": still}
    robot = {
        "name": "lever", "base": "post", "base_joint": "fixed",
        "links": [{"name": "post", **link}, {"name": "beam", **link}],
        "joints": [{"name": "hinge", "parent": "post", "child": "beam", "origin": [0, 0, 0.2],
                    "axis": [0, 1, 0]}],
        "transmission": {"motors": ["motor"], "joint_to_motor": [[1]]},
        "profiles": {"only": {"peak_torque": 5, "corner_speed": 5, "no_load_speed": 9,
                              "continuous_torque": 2, "rotor_inertia": 0.001, "friction": 0,
                              "damping": 0}},
        "sensors": {"imu": False, "switches": False},
    }  # fmt: skip
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot))
    return tmp_path


@pytest.mark.long
def test_a_robot_without_feet_runs_is_recorded_and_replayed(folder: Path) -> None:
    (folder / "graph.yaml").write_text(GRAPH)
    done = subprocess.run(
        [sys.executable, "-m", "aloft", "run", "graph.yaml", "--quiet"],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "warning" not in done.stderr
    recording = read(folder / "recordings" / "graph.rrd")
    assert recording["robot.contacts.closed"].shape == (50, 0)
    assert recording["robot.truth.contact_position"].shape == (50, 0, 3)
    command = [sys.executable, "-m", "aloft", "replay", "--check", "recordings/graph.rrd"]
    subprocess.run(command, cwd=folder, capture_output=True, check=True)


def test_a_wire_from_a_sensor_that_is_not_there_is_an_error_with_its_reason(folder: Path) -> None:
    reading = (
        "  imu: {use: blocks.StateEstimator, in: {imu: robot.imu, joints: robot.joints, "
        "contacts: detector.contacts}}\n"
        "  detector: {use: blocks.ContactDetector, in: {switches: robot.contacts}}\n"
    )
    (folder / "graph.yaml").write_text(GRAPH + reading)
    with pytest.raises(aloft.LoadError) as caught:
        aloft.load(folder / "graph.yaml")
    texts = [problem.message for problem in caught.value.report.problems]
    assert "imu.imu reads robot.imu, which is not there: lever has no IMU" in texts
    assert (
        "detector.switches reads robot.contacts, which is not there: lever has no contact points"
        in texts
    )
