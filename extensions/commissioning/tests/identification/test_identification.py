"""Biases come from where the robot stands; ticks near a change of contacts are left out.

What a run must have; that the fit finds what was injected is shown by ``tests/cli/test_robot_identify``.

The delay is found to a share of a tick, and what does not tell it is refused.
"""

from __future__ import annotations

import numpy as np
import pytest

from aloft.extensions.commissioning.identification.identification import (
    BLOCK,
    CLUSTER,
    COM,
    MARGIN,
    SOFT_SPEED,
    IdentificationError,
    MeasuredRun,
    _Assembly,
    _clustered,
    _solve,
    identify_delay,
    identify_rigid_body,
)
from aloft.mathematics.arrays import Array
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model


def motion(ticks: int = 300, stands: int = 100) -> MeasuredRun:
    velocity = np.zeros((ticks, 10))
    velocity[stands:] = 2.0
    closed = np.ones((ticks, 4), dtype=np.bool_)
    closed[200:, 1] = False
    force = np.tile([0.1, -0.05, 9.81 + 0.08], (ticks, 1))
    force[stands:] += 5.0
    return MeasuredRun(
        0.002, np.zeros((ticks, 10)), velocity, np.zeros((ticks, 10)), np.full((ticks, 3), 0.01),
        force, np.tile([0.0, 0.0, 1.0], (ticks, 1)), closed,
    )  # fmt: skip


def test_biases_are_what_is_left_of_gravity_and_rest() -> None:
    force, rate = motion().sensor_biases()
    np.testing.assert_allclose(force, [0.1, -0.05, 0.08], atol=4e-3)
    np.testing.assert_allclose(rate, 0.01)


def test_a_robot_that_never_stands_has_no_biases() -> None:
    force, rate = motion(stands=5).sensor_biases()
    assert not force.any() and not rate.any()


def test_ticks_around_a_change_of_contacts_are_not_used() -> None:
    used = motion().usable().tolist()
    assert used[0] == MARGIN + 1
    assert not set(range(200 - MARGIN, 201 + MARGIN)) & set(used)
    assert {199 - MARGIN, 201 + MARGIN} <= set(used)


ROBOT = find_robot("bruce")
N = len(ROBOT.joints)


def random_motion(ticks: int) -> MeasuredRun:
    rng = np.random.default_rng(0)
    return MeasuredRun(
        0.002, ROBOT.standing_position + rng.uniform(-0.1, 0.1, (ticks, N)),
        rng.uniform(-2.0, 2.0, (ticks, N)), rng.uniform(-5.0, 5.0, (ticks, N)),
        rng.uniform(-1.0, 1.0, (ticks, 3)), rng.uniform(-10.0, 10.0, (ticks, 3)),
        np.tile([0.0, 0.0, 1.0], (ticks, 1)), np.ones((ticks, 4), dtype=np.bool_),
    )  # fmt: skip


def test_a_run_without_motion_is_refused() -> None:
    still = random_motion(300)
    still.velocity[...] = 0.0
    with pytest.raises(IdentificationError, match="only 0 ticks with moving joints and steady con"):
        identify_rigid_body(ROBOT, still)


def test_a_robot_on_a_fixed_base_is_refused() -> None:
    arm = ROBOT.changed(base_joint="fixed")
    with pytest.raises(IdentificationError, match="bruce has a fixed base"):
        identify_rigid_body(arm, random_motion(300))


def test_forces_at_the_loaded_points_do_not_matter() -> None:
    """Torques that only balance contact forces leave the right side of every equation as it was."""
    import pinocchio as pin

    motion = random_motion(3)
    assembly = _Assembly(ROBOT, np.ones(N, dtype=np.bool_))
    rows, right = assembly._tick(motion, 1)
    built = build_pinocchio_model(ROBOT)
    data = built.model.createData()
    q = np.zeros(7 + N)
    q[6], q[7:] = 1.0, motion.position[:2].mean(axis=0)
    pin.computeJointJacobians(built.model, data, q)
    pin.updateFramePlacements(built.model, data)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = np.vstack(
        [pin.getFrameJacobian(built.model, data, f, world)[:3] for f in built.contact_frames]
    )
    _, sizes, directions = np.linalg.svd(jacobian)
    # of all forces those that need no force on the base: internal ones
    internal = np.linalg.svd(jacobian[:, :6].T)[2][6:]
    motion.torque[1] += (internal[0] @ jacobian)[6:]
    _, again = assembly._tick(motion, 1)
    np.testing.assert_allclose(again, right, atol=1e-9)
    assert np.linalg.matrix_rank(rows) >= 6 and (sizes > 1e-6).sum() == 10 and len(directions) == 16


def test_an_offset_of_the_torso_and_more_mass_are_what_the_columns_say() -> None:
    motion = random_motion(3)
    motion.closed[...] = False
    rows, _ = _Assembly(ROBOT, np.zeros(N, dtype=np.bool_))._tick(motion, 1)
    offset = np.array([0.004, -0.002, 0.003])
    links = tuple(
        link.model_copy(update={"com": tuple(np.array(link.com) + offset)})
        if link.name == ROBOT.base
        else link
        for link in ROBOT.links
    )
    other, _ = _Assembly(ROBOT.changed(links=links), np.zeros(N, dtype=np.bool_))._tick(motion, 1)
    change = rows[:, COM] @ offset
    np.testing.assert_allclose(other[:, 0] - rows[:, 0], change, atol=0.02 * np.abs(change).max())
    heavier = tuple(
        link.model_copy(
            update={"mass": 1.1 * link.mass, "inertia": tuple(1.1 * i for i in link.inertia)}
        )
        for link in ROBOT.links
    )
    more, _ = _Assembly(ROBOT.changed(links=heavier), np.zeros(N, dtype=np.bool_))._tick(motion, 1)
    np.testing.assert_allclose(more[:, 0], 1.1 * rows[:, 0], rtol=1e-9, atol=1e-9)


def test_equations_that_agree_are_solved_exactly() -> None:
    rng = np.random.default_rng(3)
    rows, unknown = rng.normal(size=(7, 4, 3)), rng.normal(size=3)
    np.testing.assert_allclose(_solve(rows, rows @ unknown), unknown, atol=1e-12)


def test_the_error_of_a_mean_is_that_of_its_clusters() -> None:
    """One unknown, the mean of n numbers: var = sum of (sums of errors by cluster)^2 / n^2, c / (c - 1)."""
    count = 6 * CLUSTER
    error = np.random.default_rng(4).normal(size=(count, 1))
    where = 500 + BLOCK * np.arange(count)
    sums = error.reshape(6, CLUSTER).sum(axis=1)
    found = _clustered(np.ones((count, 1, 1)), error, where)
    assert found.shape == (1, 1)
    assert found[0, 0] == pytest.approx((sums**2).sum() / count**2 * 6 / 5)
    # twice the rows: half of the unknown
    half = _clustered(np.full((count, 1, 1), 2.0), error, where)
    assert half[0, 0] == pytest.approx(found[0, 0] / 4.0)


def moving(ticks: int, mass: float, offset: Array, coulomb: float) -> MeasuredRun:
    """A robot in the air whose joints swing, with the torques and forces that its dynamics need."""
    import pinocchio as pin

    links = tuple(
        link.model_copy(update={
            "mass": mass * link.mass, "inertia": tuple(mass * i for i in link.inertia),
            "com": tuple(np.array(link.com) + (offset if link.name == ROBOT.base else 0.0)),
        })
        for link in ROBOT.links
    )  # fmt: skip
    model = build_pinocchio_model(ROBOT.changed(links=links)).model
    model.armature = np.zeros(model.nv)
    model.gravity.linear = np.zeros(3)
    data = model.createData()
    time = 0.002 * np.arange(ticks)
    phase = np.linspace(0.0, 5.0, N)
    rate = 6.0 + np.arange(N)
    swing = np.cos(np.outer(time, rate) + phase)
    position = ROBOT.standing_position + 0.2 * swing
    velocity = -0.2 * rate * np.sin(np.outer(time, rate) + phase)
    turning = 0.5 * np.sin(np.outer(time, [3.0, 4.0, 5.0]))
    force, torque = np.zeros((ticks, 3)), np.zeros((ticks, N))
    for k in range(1, ticks):
        q, v, a = np.zeros(7 + N), np.zeros(6 + N), np.zeros(6 + N)
        q[6], q[7:] = 1.0, 0.5 * (position[k - 1] + position[k])
        v[3:6], v[6:] = 0.5 * (turning[k - 1] + turning[k]), 0.5 * (velocity[k - 1] + velocity[k])
        a[3:6], a[6:] = (
            (turning[k] - turning[k - 1]) / 0.002,
            (velocity[k] - velocity[k - 1]) / 0.002,
        )
        # free flight: the base accelerates such that no force is needed on it
        nothing = pin.rnea(model, data, q, v, a)[:3]
        unit = np.array([pin.rnea(model, data, q, v, a + np.eye(6 + N)[i])[:3] - nothing
                         for i in range(3)]).T  # fmt: skip
        a[:3] = np.linalg.solve(unit, -nothing)
        force[k] = a[:3]
        torque[k] = pin.rnea(model, data, q, v, a)[6:] + ROBOT.rotor_matrix @ a[6:]
        torque[k] += coulomb * np.tanh(v[6:] / SOFT_SPEED) + 0.1 * v[6:]
    closed = np.zeros((ticks, 4), dtype=np.bool_)
    up = np.tile([0.0, 0.0, 1.0], (ticks, 1))
    return MeasuredRun(0.002, position, velocity, torque, turning, force, up, closed)


def test_friction_that_was_put_in_is_found_again() -> None:
    """Without a contact only the torques tell; the moments about the base are left to nobody."""
    motion = moving(700, 1.0, np.zeros(3), 0.3)
    assembly = _Assembly(ROBOT, np.ones(N, dtype=np.bool_))
    rows, right, where = assembly.blocks(motion, np.arange(1, 700))
    assert len(rows) == len(where) == 699 // BLOCK and where[0] == 1
    joints = rows[:, 6:, :]
    found = _solve(joints, right[:, 6:])
    np.testing.assert_allclose(found[4 : 4 + N], 0.3, atol=1e-6)
    np.testing.assert_allclose(found[4 + N :], 0.1, atol=1e-6)
    assert found[0] == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(found[COM], 0.0, atol=1e-6)


PERIOD = 0.002
FINE = 20


def measured(commanded: Array, delay: float) -> Array:
    """The mean torque over each tick before, if commands act ``delay`` later, on a fine grid."""
    steps = round(delay / PERIOD * FINE)
    acting = np.repeat(commanded, FINE, axis=0)
    acting = np.vstack([np.repeat(commanded[:1], steps, axis=0), acting])[: len(acting)]
    means = acting.reshape(len(commanded), FINE, -1).mean(axis=1)
    return np.vstack([commanded[:1], means[:-1]])


def commands(ticks: int = 600) -> Array:
    rng = np.random.default_rng(1)
    return np.cumsum(rng.normal(0.0, 0.2, (ticks, 10)), axis=0)


@pytest.mark.parametrize("delay", [0.0, 0.0007, 0.002, 0.0043, 0.0189])
def test_it_is_found_to_a_share_of_a_tick(delay: float) -> None:
    asked = commands()
    noise = np.random.default_rng(2).normal(0.0, 0.02, asked.shape)
    none = np.zeros(len(asked), dtype=np.bool_)
    found = identify_delay(PERIOD, asked, measured(asked, delay) + noise, none)
    assert found.delay.value == pytest.approx(delay, abs=1.5e-4)
    assert abs(found.delay.value - delay) < 3.0 * found.delay.std
    assert found.delay.std == pytest.approx(0.05 * PERIOD, rel=0.5)
    assert found.correlation > 0.95 and found.ticks > 500


def test_ticks_with_joint_feedback_are_not_used() -> None:
    asked = commands()
    seen = measured(asked, 0.004)
    feedback = np.zeros(len(asked), dtype=np.bool_)
    feedback[300:] = True
    seen[300:] = np.random.default_rng(3).normal(0.0, 10.0, seen[300:].shape)
    found = identify_delay(PERIOD, asked, seen, feedback)
    assert found.delay.value == pytest.approx(0.004, abs=1e-4)
    assert found.ticks < 300


def test_a_run_with_feedback_throughout_is_refused() -> None:
    asked = commands()
    always = np.ones(len(asked), dtype=np.bool_)
    with pytest.raises(IdentificationError, match="only 0 ticks have commands without joint feed"):
        identify_delay(PERIOD, asked, asked, always)


def test_torques_that_do_not_follow_are_refused() -> None:
    asked = commands()
    none = np.zeros(len(asked), dtype=np.bool_)
    other = np.random.default_rng(4).normal(0.0, 1.0, asked.shape)
    with pytest.raises(IdentificationError, match="do not follow the commanded ones at any delay"):
        identify_delay(PERIOD, asked, other, none)
