"""Graphs that earlier versions kept are read as this version would have written them."""

from pathlib import Path

import pytest
import yaml

from aloft.robots.description import find_robot
from aloft.runtime.language.registry import block_name
from aloft.runtime.loading import LoadError, load_text
from aloft.runtime.loading.reading.earlier_versions import in_present_form

BRUCE = find_robot("bruce")
OLD = """\
rate: 500
duration: 3
robot: bruce
blocks:
  robot:
    use: hal.MujocoRobot
    with: {seed: 3, profile: relaxed, scene: flat}
    in: {command: safety.command}
  dynamics:
    use: blocks.Dynamics
    with: {actuators: koala}
    in: {base: {value: {orientation: [0, 0, 0, 1]}}, joints: robot.joints}
  wave:
    use: runtime.SineWave
    with:
      amplitude: 0.001
      n: 10
  safety:
    use: blocks.SafetyMonitor
    in: {desired: {value: {}}, base: {value: {}}, joints: robot.joints, wbc: {value: {}}}
    rate: 250
"""


def test_an_old_graph_loads() -> None:
    graph = load_text(in_present_form(OLD, "0.1.0", BRUCE), Path("old.yaml"))
    assert graph.robot is not None and graph.robot.motors.profile == "relaxed"
    assert block_name(graph.block("wave").block_type) == "blocks.SineWave"
    assert graph.block("robot").params.model_dump()["seed"] == 3
    assert graph.block("wave").params.model_dump()["amplitude"] == 0.001
    assert graph.block("safety").period_ticks == 2
    assert [spec.path for spec in graph.blocks if "~" not in spec.path] == [
        "robot", "dynamics", "wave", "safety",
    ]  # fmt: skip


def test_without_translation_the_report_says_what_to_write() -> None:
    with pytest.raises(LoadError) as caught:
        load_text(OLD, Path("old.yaml"))
    text = str(caught.value)
    assert "said once for the graph since 0.2, beside 'robot': actuators: relaxed" in text
    assert "runtime.SineWave has been called blocks.SineWave since version 0.2" in text


def test_gains_by_position_are_given_by_name() -> None:
    text = """\
rate: 500
robot: bruce
blocks:
  joint_pd:
    use: blocks.JointPD
    with: {stance_damping: [1, 0, 1, 0, 0]}
"""
    new = in_present_form(text, "0.1.0", BRUCE)
    assert '"*_hip_yaw": 1, "*_hip_pitch": 0, "*_hip_roll": 1, "*_knee": 0, "*_ankle": 0' in new
    assert 'flight_stiffness: {"*_hip_yaw": 40.0, "*_hip_pitch": 60.0' in new  # then the default


def test_earlier_defaults_do_not_replace_what_is_written() -> None:
    text = "blocks:\n  a: {use: hal.MujocoRobot, with: {drive_damping: 2.0}}\n"
    assert "drive_damping: 2.0" in in_present_form(text, "0.1.0")
    assert "drive_damping: 0.5" in in_present_form(text.replace("drive_damping: 2.0", ""), "0.1.0")


def test_a_text_of_the_present_stays_as_it_is() -> None:
    new = in_present_form(OLD, "0.1.0", BRUCE)
    assert in_present_form(new, "0.2.0", BRUCE) is new
    assert in_present_form(OLD, "", BRUCE) == new  # its names say how old it is
    assert in_present_form("rate: [", "0.1.0") == "rate: ["
    assert in_present_form("- 1", "0.1.0") == "- 1"


def test_texts_that_look_like_references_survive() -> None:
    text = "blocks:\n  a: {use: runtime.Gain, with: {name: $$cost, other: 'on'}}\n"
    assert in_present_form(text, "0.1.0") == (
        'blocks:\n  a: {use: blocks.Gain, with: {name: $$cost, other: "on"}}\n'
    )


ESTIMATOR = """\
rate: 500
robot: bruce
blocks:
  estimator:
    use: blocks.StateEstimator
    with: {law: %s, velocity_gain: 0.1, gate: 0.08}
    in: {imu: {value: {}}, joints: {value: {}}, contacts: {value: {}}}
"""


@pytest.mark.parametrize(
    ("law", "use", "fix"),
    [
        ("complementary", "blocks.ComplementaryFilter", "use: blocks.ComplementaryFilter, a block"),
        ("weighted", "blocks.StateEstimator", "leave it out: since 0.2 blocks.StateEstimator is"),
    ],
)
def test_the_two_laws_of_the_estimator_are_two_blocks(law: str, use: str, fix: str) -> None:
    text = ESTIMATOR % law
    graph = load_text(in_present_form(text, "0.1.0", BRUCE), Path("old.yaml"))
    assert block_name(graph.block("estimator").block_type) == use
    assert graph.block("estimator").params.model_dump()["velocity_gain"] == 0.1
    with pytest.raises(LoadError, match=fix):
        load_text(text, Path("old.yaml"))


JOINT_PD = "robot: bruce\nblocks:\n  pd: {use: blocks.JointPD%s}\n"


def test_gains_in_a_list_go_to_their_joints() -> None:
    text = in_present_form(JOINT_PD % ", with: {flight_damping: [1, 2, 3, 4, 5]}")
    damping = "'*_hip_yaw': 1, '*_hip_pitch': 2, '*_hip_roll': 3, '*_knee': 4, '*_ankle': 5"
    told = yaml.safe_load(text)["blocks"]["pd"]["with"]
    assert told["flight_damping"] == yaml.safe_load(f"{{{damping}}}")


def test_what_version_0_1_did_by_default_is_said() -> None:
    given = JOINT_PD % ", with: {flight_damping: 0.7}"
    told = yaml.safe_load(in_present_form(given, "0.1.0"))["blocks"]["pd"]["with"]
    assert told["flight_damping"] == 0.7
    assert told["flight_stiffness"]["*_ankle"] == 15
    assert in_present_form(given, "0.2.0") is given
    assert in_present_form(given) is given
