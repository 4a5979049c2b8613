"""What a run must have; that the fit finds what was injected is shown by ``tests/cli/test_robot_identify``."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.description import find_robot
from aloft.robots.identification.motion import Motion
from aloft.robots.identification.rigid_body import (
    COM,
    IdentificationError,
    _Assembly,
    identify_rigid_body,
)
from aloft.robots.pinocchio_model import build_pinocchio_model

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)


def random_motion(ticks: int) -> Motion:
    rng = np.random.default_rng(0)
    return Motion(
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
