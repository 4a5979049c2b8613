"""Operating points against closed forms, and robots that rest where they are found to."""

from pathlib import Path
from textwrap import dedent, indent

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import linearise, trim

GRAPHS = Path(__file__).parents[3] / "graphs"
PROJECTS = Path(__file__).parents[3] / "docs" / "projects"
G = 9.81
SPRING = """
  f: {use: blocks.Constant, with: {value: [0.0], unit: N}}
  k: {use: blocks.Gain, with: {gain: -50.0, unit: N/m}, in: {u: x.y}}
  a: {use: blocks.Sum, in: {a: f.y, b: k.y}}
  m: {use: blocks.Gain, with: {gain: 0.5, unit: 1/kg}, in: {u: a.y}}
  v: {use: blocks.Integrator, in: {u: m.y}}
  x: {use: blocks.Integrator, in: {u: {from: v.y, delay: 2}}}
"""
AT_REST = ("x.x.value", "v.x.value")


def graph(blocks: str) -> aloft.Graph:
    return aloft.load("rate: 1 kHz\nblocks:\n" + indent(dedent(blocks), "  "))


def test_a_mass_on_a_spring_rests_where_the_force_is_the_springs() -> None:
    found = trim(graph(SPRING), free=["f.y", *AT_REST], hold="x.y == 0.1")
    assert found.success
    assert found.values["f.y.value[0]"] == pytest.approx(50.0 * 0.1, rel=1e-9)
    assert found.values["v.x.value[0]"] == pytest.approx(0.0, abs=1e-9)
    assert found.settings["f.value"] == pytest.approx([5.0])
    other = trim(graph(SPRING.replace("[0.0]", "[2.0]")), free=AT_REST)
    assert other.values["x.x.value[0]"] == pytest.approx(2.0 / 50.0, rel=1e-6)


def test_a_condition_that_cannot_hold_is_named_with_the_bound_in_the_way() -> None:
    found = trim(graph(SPRING), free=["f.y=0 N:4 N", *AT_REST], hold="x.y == 0.1")
    assert not found.success
    assert "x.y.value[0] == 0.1" in found.reason
    assert found.at_bound == ("f.y.value[0]",)
    assert found.values["f.y.value[0]"] == pytest.approx(4.0)
    within = trim(graph(SPRING), free=["f.y", *AT_REST], hold=["x.y >= 0.02", "x.y <= 0.03"])
    assert within.success
    assert 1.0 - 1e-5 < within.values["f.y.value[0]"] < 1.5 + 1e-5


FLYER = """
  thrust: {use: blocks.Constant, with: {value: [5.0]}}
  pitch: {use: blocks.Constant, with: {value: [0.1]}}
  ax: {use: blocks.Expression, with: {expression: "a * sin(b) - k * c", constants: {k: 0.4}, units: {k: 1/s}}, in: {a: thrust.y, b: pitch.y, c: vx.y}}
  az: {use: blocks.Expression, with: {expression: "a * cos(b) - 9.81"}, in: {a: thrust.y, b: pitch.y}}
  vx: {use: blocks.Integrator, in: {u: ax.y}}
  vz: {use: blocks.Integrator, in: {u: az.y}}
"""


@pytest.mark.parametrize("speed", [0.0, 3.0, -8.0])
def test_a_flyer_hovers_and_flies_ahead_with_the_pitch_and_thrust_of_the_closed_form(
    speed: float,
) -> None:
    found = trim(
        graph(FLYER), free=["thrust.y=0:40", "pitch.y=-1.4:1.4", "vx.x.value", "vz.x.value"],
        hold=[f"vx.y == {speed}", "vz.y == 0"],
    )  # fmt: skip
    assert found.success, found.reason
    assert found.values["pitch.y.value[0]"] == pytest.approx(np.arctan2(0.4 * speed, G), abs=1e-6)
    assert found.values["thrust.y.value[0]"] == pytest.approx(np.hypot(0.4 * speed, G), rel=1e-6)


def test_a_state_that_is_set_is_no_unknown_and_must_stay() -> None:
    found = trim(graph(SPRING), free=["f.y", "v.x.*"], hold="x.x.value == 0.2")
    assert list(found.values) == ["v.x.value[0]", "f.y.value[0]"]
    assert found.values["f.y.value[0]"] == pytest.approx(10.0, rel=1e-9)


def test_a_run_is_left_in_the_operating_point_and_can_be_linearised_there() -> None:
    with graph(SPRING.replace("[0.0]", "[2.0]")).open() as run:
        assert trim(run, free=AT_REST).success
        x = run["x.y.value"]
        assert x == pytest.approx([0.04], rel=1e-6)
        run.step(500)
        assert run["x.y.value"] == pytest.approx(x, rel=1e-5)
        assert linearise(run, inputs="f.y", outputs="x.y").states[-1] == "x.x.value[0]"
        before = run.snapshot()
        assert not trim(run, free="f.y=0:1", hold="x.y == 3").success
        assert run.snapshot() == before


def test_an_arm_holds_its_weight_with_the_torque_of_the_formula() -> None:
    """Two links in a vertical plane: tau = sum of m g times the horizontal lever of each centre of mass."""
    quiet = {
        "robot.sensors.encoder_offset": 0.0,
        "robot.sensors.joint_velocity_noise": 0.0,
        "robot.latency": 0.0,
    }
    with aloft.load(PROJECTS / "arm" / "reach.yaml", quiet).open() as run:
        found = trim(
            run, free="reach.command.torque[*]", settle=2, tolerance=1e-5,
            hold=["robot.shoulder.position == -0.4", "robot.elbow.position == 0.9", "robot.*.velocity == 0",],
        )  # fmt: skip
        assert found.success, found.reason
        plant = run.block("robot").plant  # type: ignore[attr-defined]
        model, data = plant.model, plant.data
        import mujoco

        mujoco.mj_forward(model, data)
        axes, anchors = data.xaxis, data.xanchor
        torque = []
        for j in range(model.njnt):
            total = 0.0
            for b in range(1, model.nbody):
                parent = b
                while parent and parent != model.jnt_bodyid[j]:
                    parent = model.body_parentid[parent]
                if parent:
                    lever = np.cross(
                        data.xipos[b] - anchors[j], [0.0, 0.0, -G * model.body_mass[b]]
                    )
                    total -= float(lever @ axes[j])
            torque.append(total)
        command, angle = run["reach.command"], run["robot.joints.position"]
    drives = [*found.values.values()] + command.stiffness * (command.position - angle)
    assert drives == pytest.approx(torque, rel=2e-3, abs=2e-3)


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ({"free": "f.z"}, "there is no signal 'f.z'.*nor is it a state"),
        ({"free": "f.y=3"}, "'f.y=3' is no signal"),
        ({"free": "f.y=3:1"}, "the lower bound is not below the upper one"),
        ({"free": "f.y=0:3 m"}, "'3 m' is not in N"),
        ({"free": ["f.y", "f.y"], "hold": "x.y == 1"}, r"f.y.value\[0\] is free twice"),
        ({"free": "f.y", "hold": "x.y"}, "is no condition; write block.port.field == value"),
        ({"free": "f.y", "hold": "x.x.value >= 1"}, "x.x.value is a state; set it with =="),
        ({"free": "f.y"}, "nothing is asked for"),
        ({"free": []}, "nothing is free"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_said(asked: dict, text: str) -> None:
    with pytest.raises(aloft.AloftError, match=text):
        trim(graph(SPRING), **asked)


def test_a_command_that_comes_too_late_is_named() -> None:
    late = SPRING.replace("{a: f.y", "{a: {from: f.y, delay: 8}")
    found = trim(graph(late), free=["f.y", *AT_REST], hold="x.y == 0.1")
    assert not found.success
    assert "no condition depends on f.y.value[0] within the periods that are run" in found.reason
    assert trim(graph(late), free=["f.y", *AT_REST], hold="x.y == 0.1", settle=10).success


@pytest.mark.long
@pytest.mark.parametrize(
    ("file", "height", "pitch"),
    [("push.yaml", 0.37, 0.02), ("robots/go2_stand.yaml", 0.3, -0.02)],
)
def test_robots_rest_in_a_pose_of_given_height_and_pitch(
    file: str, height: float, pitch: float
) -> None:
    with aloft.load(GRAPHS / file, {"robot.jitter": 0.0}).open() as run:
        robot = run.graph.robot
        assert robot is not None
        joints = [joint.name for joint in robot.joints]
        found = trim(
            run, at=0.3, tolerance=1e-4,
            free=["safety.command.torque[*]", "robot.base.orientation", *(f"robot.{j}.position" for j in joints)],
            hold=["robot.base.*velocity == 0", f"robot.base.position[2] == {height}",
                  f"robot.base.orientation.rotation_y == {pitch}", *(f"robot.{j}.velocity == 0" for j in joints)],
        )  # fmt: skip
        assert found.success, found.reason
        model = run.block("robot").plant.model  # type: ignore[attr-defined]
        weight = G * float(model.body_mass.sum())
        force = run["robot.truth.contact_force"].sum(axis=0)
        assert force[2] == pytest.approx(weight, rel=0.01)
        assert run["robot.truth.base_position"][2] == pytest.approx(height, abs=1e-5)
