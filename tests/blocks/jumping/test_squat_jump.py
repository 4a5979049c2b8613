"""The planned jump obeys physics and the task; the block plays it back, and says what it needs."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from aloft.blocks.jumping.squat_jump import (
    SquatJumpParameters,
    SquatJumpReference,
    plan_squat_jump,
)
from aloft.blocks.signals import Phase
from aloft.mathematics.constants import GRAVITY
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

from ...robots.limbed_robots import quadruped

ROBOT = find_robot("bruce")
BUILT = build_pinocchio_model(ROBOT)
DEFAULTS = SquatJumpParameters()


def plan(**changes):
    return plan_squat_jump(BUILT, ROBOT, SquatJumpParameters(**changes))


@pytest.fixture(scope="module")
def in_place():
    return plan()


@pytest.fixture(scope="module")
def forward():
    return plan(distance=0.06, rise=0.06)


def configurations(table):
    """Every row's configuration and velocity, the base put where the feet say it is."""
    columns, data = table.columns, BUILT.model.createData()
    for i in range(len(table.time)):
        q, v = pin.neutral(BUILT.model), np.zeros(16)
        q[3:7], q[7:] = columns["orientation"][i], columns["joint_position"][i]
        v[3:6], v[6:] = columns["angular_velocity"][i], columns["joint_velocity"][i]
        pin.framesForwardKinematics(BUILT.model, data, q)
        feet = np.array([data.oMf[frame].translation for frame in BUILT.sole_frames])
        q[:3] = columns["foot_position"][i].mean(axis=0) - feet.mean(axis=0)
        rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
        jacobians = [
            pin.computeFrameJacobian(
                BUILT.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            for frame in BUILT.sole_frames
        ]
        moved = np.mean([j[:3] @ v for j in jacobians], axis=0)
        v[:3] = rotation.T @ (columns["foot_velocity"][i].mean(axis=0) - moved)
        yield i, q, v, data


@pytest.mark.parametrize("which", ["in_place", "forward"])
def test_joints_feet_com_and_momentum_agree(which, request):
    table = request.getfixturevalue(which)
    found: dict[str, list[np.ndarray]] = {}
    for _, q, v, data in configurations(table):
        pin.computeCentroidalMomentum(BUILT.model, data, q, v)
        com = pin.centerOfMass(BUILT.model, data, q, v)
        pin.framesForwardKinematics(BUILT.model, data, q)
        for name, value in (
            ("com", com),
            ("com_velocity", data.vcom[0].copy()),
            ("angular_momentum", data.hg.angular.copy()),
            ("foot_position", [data.oMf[frame].translation for frame in BUILT.sole_frames]),
        ):
            found.setdefault(name, []).append(np.array(value))
    for name, values in found.items():
        error = 1e-8 if name in ("com_velocity", "angular_momentum") else 2e-5
        np.testing.assert_allclose(values, table.columns[name], rtol=1e-6, atol=error, err_msg=name)


def test_feet_stand_still_and_flat_until_lift_off(in_place):
    standing = in_place.time <= in_place.lift_off_time
    feet = in_place.columns["foot_position"][standing][:-1]
    assert np.abs(feet - feet[0]).max() < 1e-5
    assert np.abs(feet[0].mean(axis=0)).max() < 1e-12


def test_flight_is_ballistic_with_constant_momentum(forward):
    flying = (forward.time > forward.lift_off_time) & (forward.time < forward.touchdown_time)
    time, columns = forward.time[flying], forward.columns
    com, momentum = columns["com"][flying], columns["angular_momentum"][flying]
    assert np.ptp(momentum, axis=0).max() == 0.0
    fall = np.polyfit(time, com[:, 2], 2)[0]
    assert fall == pytest.approx(-GRAVITY / 2.0, rel=1e-6)
    assert np.ptp(np.diff(com[:, 0]) / np.diff(time)) < 1e-9


def test_the_task_is_met(in_place, forward):
    for table, rise, distance in ((in_place, DEFAULTS.rise, 0.0), (forward, 0.06, 0.06)):
        com, last = table.columns["com"], table.columns["foot_position"][-1]
        assert com[:, 2].max() - com[0, 2] == pytest.approx(rise, abs=1e-4)
        low = com[table.time < table.lift_off_time, 2].min()
        assert low == pytest.approx(com[0, 2] - DEFAULTS.squat_depth, abs=1e-6)
        assert com[:, 2].min() >= low - 1e-3
        assert last.mean(axis=0) == pytest.approx([distance, 0.0, 0.0], abs=1e-4)
        touchdown = np.searchsorted(table.time, table.touchdown_time)
        pitch = 2.0 * np.arctan2(*table.columns["orientation"][touchdown][[1, 3]])
        assert pitch == pytest.approx(DEFAULTS.touchdown_pitch, abs=2e-3)
        assert table.columns["com"][-1] == pytest.approx([distance, 0.0, com[0, 2]], abs=1e-6)


def test_contact_forces_push_and_stay_within_the_feet(in_place):
    """Newton's and Euler's equations of the thrust: a centre of pressure under the soles."""
    thrust = (in_place.time >= in_place.thrust_time) & (in_place.time < in_place.lift_off_time)
    c = {name: rows[thrust] for name, rows in in_place.columns.items()}
    force = ROBOT.total_mass * (c["com_acceleration"] + [0.0, 0.0, GRAVITY])
    assert force[:, 2].min() > 0.0
    # k' = (p - com) x F about y: -com_z F_x - (p - com_x) F_z.
    pressure = c["com"][:, 0] - (
        c["angular_momentum_rate"][:, 1] + c["com"][:, 2] * force[:, 0]
    ) / np.maximum(force[:, 2], 1.0)
    assert np.abs(pressure).max() < 0.0425


def test_motors_stay_below_their_speed(in_place):
    before = in_place.time < in_place.lift_off_time
    speed = in_place.columns["joint_velocity"][before] @ ROBOT.joint_to_motor.T
    assert np.abs(speed).max() < ROBOT.profiles["koala"].no_load_speed


def test_left_and_right_mirror(in_place):
    joints = in_place.columns["joint_position"]
    mirror = np.array([-1.0, 1.0, -1.0, 1.0, 1.0])
    assert joints[:, 5:] == pytest.approx(joints[:, :5] * mirror, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"rise": 0.13, "lean": 0.9}, "rad/s, but koala reaches 30.0 rad/s; ask for less"),
        ({"squat_depth": 0.149, "lean": 1.2}, "past its limit; ask for less"),
    ],
)
def test_what_the_robot_cannot_do_is_refused(changes, part):
    with pytest.raises(BlockError) as error:
        plan(**changes)
    assert part in str(error.value)


@pytest.mark.long
def test_a_quadruped_with_ball_feet_jumps_too():
    robot = quadruped()
    task = {
        "rise": 0.06, "squat_depth": 0.06, "lift_off_drop": 0.01, "touchdown_drop": 0.01,
        "landing_depth": 0.04, "lean": 0.0, "touchdown_pitch": 0.0, "distance": 0.05,
    }  # fmt: skip
    built = build_pinocchio_model(robot)
    table = plan_squat_jump(built, robot, SquatJumpParameters(**task))
    columns = table.columns
    height = columns["com"][:, 2]
    assert height.max() == pytest.approx(height[0] + 0.06, abs=1e-4)
    moved = columns["foot_position"][-1] - columns["foot_position"][0]
    assert moved == pytest.approx(np.tile([0.05, 0.0, 0.0], (4, 1)), abs=0.006)  # the balls roll
    flight = (table.time > table.lift_off_time) & (table.time < table.touchdown_time)
    data = built.model.createData()
    for row in np.flatnonzero(flight)[::10]:
        q = pin.neutral(built.model)
        q[3:7], q[7:] = columns["orientation"][row], columns["joint_position"][row]
        v = np.zeros(built.model.nv)
        v[3:6], v[6:] = columns["angular_velocity"][row], columns["joint_velocity"][row]
        pin.computeCentroidalMomentum(built.model, data, q, v)
        assert data.hg.angular == pytest.approx(columns["angular_momentum"][row], abs=1e-6)


def test_the_plan_runs_through_every_phase():
    bench = BlockBench(SquatJumpReference, robot="bruce", rate=500.0, plain=True)
    reference, phases = bench.get("reference"), []
    for tick in range(1500):
        bench.step()
        assert abs(float(reference.time) - tick * 0.002) < 1e-9
        assert abs(np.linalg.norm(reference.orientation) - 1.0) < 1e-12
        if not phases or phases[-1] != int(reference.phase):
            phases.append(int(reference.phase))
    assert phases == [
        Phase.STAND, Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING, Phase.RECOVER,
    ]  # fmt: skip


def test_it_goes_on_from_a_snapshot():
    bench = BlockBench(SquatJumpReference, robot="bruce")
    bench.step(550)
    snapshot = bench.snapshot()
    bench.step(20)
    wanted = bench.get("reference").joint_position.copy()
    bench.restore(snapshot)
    bench.step(20)
    assert (bench.get("reference").joint_position == wanted).all()


def test_it_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(
            SquatJumpReference,
            dimensions={"n_joints": 10, "n_contacts": 4, "n_feet": 2, "n_velocities": 16},
        )
