"""The symbolic model agrees with Pinocchio's model of the same robot."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from aloft.planner.models.symbolic_model import (
    SymbolicModel,
    base_angular_acceleration,
    base_angular_velocity,
    base_rotation,
    centroidal_momentum,
)
from aloft.robots.description import find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model

TOLERANCE = 1e-10
ROBOT = find_robot("bruce")
MODEL = SymbolicModel(ROBOT)
PEER = build_pinocchio_model(ROBOT)
DATA = PEER.model.createData()


def evaluate(expressions: list[Any], symbols: list[Any], values: list[Any]) -> list[Any]:
    function = ca.Function("f", symbols, expressions)
    return [np.array(value) for value in function.call([ca.DM(v) for v in values])]


def random_motion(seed: int) -> tuple[Any, Any, Any]:
    """Coordinates, velocities, accelerations; the pitch beyond a full turn."""
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-1.0, 1.0, (3, 16)) * np.array([[1.0], [5.0], [50.0]])
    q[3] = rng.uniform(-9.0, 9.0)
    return q, v, a


def to_pinocchio(q: Any, v: Any, a: Any) -> tuple[Any, Any, Any]:
    """The same motion in Pinocchio's coordinates: base twist and its derivative in the body."""
    rotation, spin, turn = (
        evaluate([e(*s)], s, x)[0]
        for e, s, x in (
            (base_rotation, [ca.SX.sym("q", 3)], [q[3:6]]),
            (base_angular_velocity, [ca.SX.sym("q", 3), ca.SX.sym("v", 3)], [q[3:6], v[3:6]]),
            (
                base_angular_acceleration,
                [ca.SX.sym("q", 3), ca.SX.sym("v", 3), ca.SX.sym("a", 3)],
                [q[3:6], v[3:6], a[3:6]],
            ),
        )
    )
    spin, turn = spin.ravel(), turn.ravel()
    quaternion = pin.Quaternion(rotation).coeffs()
    speed = rotation.T @ v[:3]
    pull = rotation.T @ a[:3] - np.cross(spin, speed)
    return (
        np.concatenate([q[:3], quaternion, q[6:]]),
        np.concatenate([speed, spin, v[6:]]),
        np.concatenate([pull, turn, a[6:]]),
    )


@pytest.mark.parametrize("seed", range(5))
def test_inverse_dynamics_agrees(seed: int) -> None:
    q, v, a = random_motion(seed)
    forces = np.random.default_rng(seed + 100).uniform(-50.0, 50.0, (4, 3))
    symbols = [ca.SX.sym("q", 16), ca.SX.sym("v", 16), ca.SX.sym("a", 16), ca.SX.sym("f", 12)]
    named = {c.name: symbols[3][3 * i : 3 * i + 3] for i, c in enumerate(ROBOT.contacts)}
    base, passed, torque = MODEL.inverse_dynamics(*symbols[:3], named)
    total = MODEL.base_wrench(base, passed, 1)
    found = evaluate([ca.vertcat(total, torque)], symbols, [q, v, a, forces.ravel()])[0].ravel()

    pq, pv, pa = to_pinocchio(q, v, a)
    expected = pin.rnea(PEER.model, DATA, pq, pv, pa) + PEER.rotor_coupling @ pa
    pin.computeJointJacobians(PEER.model, DATA, pq)
    pin.updateFramePlacements(PEER.model, DATA)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for index, force in zip(PEER.contact_frames, forces, strict=True):
        expected -= pin.getFrameJacobian(PEER.model, DATA, index, frame)[:3].T @ force
    assert np.abs(found - expected).max() < TOLERANCE


@pytest.mark.parametrize("seed", range(5))
def test_momentum_and_centre_of_mass_agree(seed: int) -> None:
    q, v, a = random_motion(seed)
    symbols = [ca.SX.sym("q", 16), ca.SX.sym("v", 16)]
    whole = centroidal_momentum(MODEL, *symbols)
    found = evaluate([whole.linear, whole.angular, MODEL.com(symbols[0])], symbols, [q, v])
    pq, pv, _ = to_pinocchio(q, v, a)
    momentum = pin.computeCentroidalMomentum(PEER.model, DATA, pq, pv)
    com = pin.centerOfMass(PEER.model, DATA, pq)
    assert np.abs(found[0].ravel() - momentum.linear).max() < TOLERANCE
    assert np.abs(found[1].ravel() - momentum.angular).max() < TOLERANCE
    assert np.abs(found[2].ravel() - com).max() < TOLERANCE


@pytest.mark.parametrize("seed", range(5))
def test_contact_points_and_their_velocities_agree(seed: int) -> None:
    q, v, a = random_motion(seed)
    symbols = [ca.SX.sym("q", 16), ca.SX.sym("v", 16)]
    points = ca.vertcat(*MODEL.contact_points(symbols[0]))
    speeds = ca.jtimes(points, symbols[0], symbols[1])
    place, speed = (x.reshape(4, 3) for x in evaluate([points, speeds], symbols, [q, v]))
    pq, pv, _ = to_pinocchio(q, v, a)
    pin.forwardKinematics(PEER.model, DATA, pq, pv)
    pin.updateFramePlacements(PEER.model, DATA)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for i, index in enumerate(PEER.contact_frames):
        assert np.abs(place[i] - DATA.oMf[index].translation).max() < TOLERANCE
        peer = pin.getFrameVelocity(PEER.model, DATA, index, frame).linear
        assert np.abs(speed[i] - peer).max() < TOLERANCE


def test_one_limb_alone_is_its_share_of_the_whole() -> None:
    q, v, a = random_motion(7)
    symbols = [ca.SX.sym("q", 16), ca.SX.sym("v", 16), ca.SX.sym("a", 16)]
    _, both, torque = MODEL.inverse_dynamics(*symbols, {})
    _, one, alone = MODEL.inverse_dynamics(*symbols, {}, limbs=[1])
    hip = MODEL.limbs[1][0]
    found = evaluate([both[hip] - one[hip], torque[5:] - alone[5:], alone[:5]], symbols, [q, v, a])
    assert max(np.abs(x).max() for x in found[:2]) < 1e-9
    # Rotors of other limbs do not move with this one.
    assert np.abs(found[2]).max() == 0.0
