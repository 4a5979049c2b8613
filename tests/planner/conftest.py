"""A plan made by hand: the parametric squat jump, with the contact forces that its motion needs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.planner.one_interval import integrate, joint_motion

from aloft.blocks.jumping.squat_jump import SquatJumpParameters, plan_squat_jump
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.task.phase import Phase
from aloft.planner.task.plan import PlannedJump
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model

RISE = 0.085
"""m"""
EVERY = 10
"""Knots every so many rows of the table, 20 ms."""


def squat_jump_plan(every: int = EVERY) -> PlannedJump:
    """The squat jump as a plan. Its feet hit the ground with the speed of the fall."""
    robot = find_robot("bruce")
    dynamics = ExactDynamics(robot)
    jump = SquatJumpParameters(rise=RISE, touchdown_pitch=0.0, stand_time=0.1, pause_time=0.05)
    table = plan_squat_jump(build_pinocchio_model(robot), robot, jump)
    breaks = np.flatnonzero(np.diff(table.time) < 1e-9).tolist()
    ends = [0, *[k + 1 for k in breaks], len(table.time)]
    rows = []
    for first, last in pairwise(ends):
        rows += [*range(first, last - 1, every), last - 1]
    # The phases meet in two rows of one instant; only at touchdown do they differ.
    keep = [
        k
        for k in rows
        if k not in breaks or np.isclose(table.time[k], table.touchdown_time, atol=1e-9)
    ]
    time, columns = table.time[keep], {name: c[keep] for name, c in table.columns.items()}
    time = np.round(time, 12)
    count, pin = len(time), dynamics.pin
    position, velocity = np.zeros((count, 17)), np.zeros((count, 16))
    for k in range(count):
        q, v = pin.neutral(dynamics.model), np.zeros(16)
        q[3:7], q[7:] = columns["orientation"][k], columns["joint_position"][k]
        v[3:6], v[6:] = columns["angular_velocity"][k], columns["joint_velocity"][k]
        q[:3] = columns["com"][k] - dynamics.centroidal(q, v)[0]
        rotation = pin.Quaternion(q[3:7]).toRotationMatrix()
        v[:3] = rotation.T @ (columns["com_velocity"][k] - dynamics.centroidal(q, v)[1])
        position[k], velocity[k] = q, v
    phase = np.full(count, Phase.STAND)
    for start, value in (
        (table.squat_time, Phase.SQUAT),
        (table.thrust_time, Phase.THRUST),
        (table.lift_off_time, Phase.FLIGHT),
        (table.touchdown_time, Phase.LANDING),
        (table.recover_time, Phase.RECOVER),
    ):
        phase[time > start - 1e-9] = value
    contact = np.repeat((phase != Phase.FLIGHT)[:, None], 4, axis=1)
    states = [dynamics.centroidal(q, v) for q, v in zip(position, velocity, strict=True)]
    plan = PlannedJump(
        task=make_task({"name": "by_hand", "formulation": "srbm", "rise": RISE, "impact": True}),
        time=time,
        position=position,
        velocity=velocity,
        acceleration=np.zeros((count, 16)),
        contact_force=np.zeros((count, 4, 3)),
        contact=contact,
        phase=phase.astype(np.int64),
        joint_torque=np.zeros((count, 10)),
        com=np.array([s[0] for s in states]),
        com_velocity=np.array([s[1] for s in states]),
        angular_momentum=np.array([s[2] for s in states]),
        lift_off_time=table.lift_off_time,
        touchdown_time=table.touchdown_time,
    )
    return with_forces(plan, dynamics)


def with_forces(plan: PlannedJump, dynamics: ExactDynamics) -> PlannedJump:
    """The plan with the smallest forces that change its momentum as it does."""
    force, torque = plan.contact_force.copy(), plan.joint_torque.copy()
    gravity = np.array([0.0, 0.0, -9.81])
    for k in range(len(plan.time) - 1):
        h = plan.time[k + 1] - plan.time[k]
        linear = dynamics.mass * (plan.com_velocity[k + 1] - plan.com_velocity[k])
        angular = plan.angular_momentum[k + 1] - plan.angular_momentum[k]
        if h > 0.0:
            linear, angular = linear / h - dynamics.mass * gravity, angular / h
        middle = 0.5 * (plan.com[k] + plan.com[k + 1])
        points = 0.5 * (dynamics.points(plan.position[k]) + dynamics.points(plan.position[k + 1]))
        rows = np.zeros((6, 12))
        for number, point in enumerate(points):
            x, y, z = point - middle
            rows[:3, 3 * number : 3 * number + 3] = np.eye(3)
            rows[3:, 3 * number : 3 * number + 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        if plan.phase[k] != Phase.FLIGHT or h == 0.0:
            force[k] = np.linalg.lstsq(rows, np.append(linear, angular), rcond=None)[0].reshape(
                4, 3
            )
        joints = joint_motion(plan.position, plan.velocity, plan.time, k)
        if h > 0.0:
            states = integrate(
                dynamics, plan.position[k], plan.velocity[k], joints, force[k], 0.5 * h
            )
            _, q, v = states[0]
            torque[k] = dynamics.joint_torque(q, v, joints.at(0.5 * h)[2], force[k])
    force[-1], torque[-1] = force[-2], torque[-2]
    return replace(plan, contact_force=force, joint_torque=torque)


@pytest.fixture(scope="session")
def by_hand() -> PlannedJump:
    return squat_jump_plan()


@pytest.fixture(scope="session")
def by_hand_finely() -> PlannedJump:
    """The same with knots every 10 ms."""
    return squat_jump_plan(5)
