"""The symbolic model of robots with slanted and sliding joints, held joints, ball feet and flat feet
agrees with Pinocchio's model of the same robot."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from tests.planner.models.test_symbolic_model import evaluate, to_pinocchio
from tests.robots.example_robots import INSTALLED
from tests.robots.limbed_robots import LIGHT_QUADRUPED, humanoid, quadruped, slider

from aloft.planner.models.coordinates import full_coordinates, mirrored_coordinates
from aloft.planner.models.euler_angles import rotation
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.models.robot_model import model_of
from aloft.planner.models.symbolic_model import SymbolicModel, centroidal_momentum
from aloft.planner.models.symmetry import mirrored_pairs, symmetrised
from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.welding import welded

MADE = {
    "quadruped": quadruped,
    "light_quadruped": lambda: quadruped(LIGHT_QUADRUPED),
    "humanoid": humanoid,
    "slider": slider,
}
NAMES = [*MADE, *(["go2", "solo12", "g1"] if INSTALLED else [])]


@lru_cache(maxsize=1)
def robot_and_model(name: str) -> tuple[RobotDescription, SymbolicModel]:
    robot = MADE[name]() if name in MADE else find_robot(name)
    return welded(robot).robot, model_of(robot)[0]


def motion(size: int) -> tuple[Any, Any, Any]:
    q, v, a = np.random.default_rng(3).uniform(-1.0, 1.0, (3, size)) * [[0.8], [3.0], [20.0]]
    return q, v, a


@pytest.mark.parametrize("name", NAMES)
def test_dynamics_agree(name: str) -> None:
    robot, model = robot_and_model(name)
    q, v, a = motion(model.size)
    contacts = len(robot.contacts)
    forces = np.random.default_rng(4).uniform(-50.0, 50.0, (contacts, 3))
    symbols = [ca.SX.sym(x, model.size) for x in "qva"] + [ca.SX.sym("f", 3 * contacts)]
    named = {c.name: symbols[3][3 * i : 3 * i + 3] for i, c in enumerate(robot.contacts)}
    base, passed, torque = model.inverse_dynamics(*symbols[:3], named)
    _, linear, angular = centroidal_momentum(model, *symbols[:2])
    found = evaluate(
        [ca.vertcat(model.base_wrench(base, passed, 1), torque), linear, angular, model.com(symbols[0])],
        symbols, [q, v, a, forces.ravel()],
    )  # fmt: skip
    peer = ExactDynamics(robot)
    pq, pv, pa = to_pinocchio(q, v, a)
    expected = (
        pin.rnea(peer.model, peer.data, pq, pv, pa)
        - peer.contact_jacobians(pq)[1].T @ forces.ravel()
    )
    rotors = robot.rotor_matrix
    expected[6:] += (rotors - np.diag(np.diag(rotors))) @ pa[6:]
    assert np.abs(found[0].ravel() - expected).max() < 1e-10
    com, speed, momentum = peer.centroidal(pq, pv)
    assert np.abs(found[1].ravel() - robot.total_mass * speed).max() < 1e-10
    assert np.abs(found[2].ravel() - momentum).max() < 1e-10
    assert np.abs(found[3].ravel() - com).max() < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_contact_points_agree(name: str) -> None:
    robot, model = robot_and_model(name)
    q, v, a = motion(model.size)
    symbol = ca.SX.sym("q", model.size)
    found = evaluate([ca.horzcat(*model.contact_points(symbol))], [symbol], [q])[0].T
    assert np.abs(found - ExactDynamics(robot).points(to_pinocchio(q, v, a)[0])).max() < 1e-10


def test_a_ball_that_turns_in_one_plane_rolls_without_slipping() -> None:
    """The material where it touches stands still exactly where the foothold does."""
    robot, model = robot_and_model("quadruped")
    q, v = np.zeros(model.size), np.zeros(model.size)
    q[3], q[6:] = 0.1, robot.standing_position
    v[[0, 2, 3]], v[7::3], v[8::3] = (0.3, -0.2, 0.5), 1.1, -0.7
    symbols = [ca.SX.sym("q", model.size), ca.SX.sym("v", model.size)]
    rates = [ca.jtimes(foothold, *symbols) for foothold in model.footholds(symbols[0])]
    found = evaluate([ca.horzcat(*rates)], symbols, [q, v])[0].T
    pq, pv, _ = to_pinocchio(q, v, np.zeros(model.size))
    material = (ExactDynamics(robot).contact_jacobians(pq)[1] @ pv).reshape(-1, 3)
    assert np.abs(found - material).max() < 1e-10
    assert np.abs(material).max() > 0.1


@pytest.mark.parametrize("heading", [0.0, 0.5, -2.0])
def test_a_ball_rolls_with_a_leg_that_is_rolled_and_pitched(heading: float) -> None:
    """A hip that is turned by 0.2 rad, as in a jump aside, leaves an error of 2 %, and a robot that is
    turned to another heading none beside it."""
    robot, model = robot_and_model("quadruped")
    q, v = np.zeros(model.size), np.zeros(model.size)
    q[3], q[5], q[6:] = 0.1, heading, robot.standing_position
    q[6::3], v[6::3], v[7::3], v[8::3] = 0.2, 0.6, 1.1, -0.7
    symbols = [ca.SX.sym("q", model.size), ca.SX.sym("v", model.size)]
    places = model.footholds(symbols[0], None, (np.cos(heading), np.sin(heading)))
    rates = [ca.jtimes(foothold, *symbols) for foothold in places]
    found = evaluate([ca.horzcat(*rates)], symbols, [q, v])[0].T
    pq, pv, _ = to_pinocchio(q, v, np.zeros(model.size))
    body = ExactDynamics(robot)
    material = (body.contact_jacobians(pq)[1] @ pv).reshape(-1, 3)
    ball = max(contact.radius for contact in robot.contacts)
    assert np.abs(found - material).max() < 0.02 * ball * np.abs(v).max()
    body.points(pq)
    numbers = evaluate([ca.horzcat(*places)], symbols[:1], [q])[0].T
    assert np.abs(body.footholds(heading) - numbers).max() < 1e-12


def test_the_torque_of_a_held_joint_is_the_whole_robots() -> None:
    robot = humanoid()
    part = welded(robot)
    loads = {robot.joints[load.joint].name: load for load in part.loads}
    assert list(loads) == ["waist"]
    assert loads["waist"].most == robot.motors.peak_torque[0]
    model = SymbolicModel(part.robot, part.loads)
    q, v, a = motion(model.size)
    symbols = [ca.SX.sym(x, model.size) for x in "qva"]
    found = evaluate(model.held_torques(*symbols, {}), symbols, [q, v, a])[0]
    peer = ExactDynamics(robot)
    pq, pv, pa = (np.zeros(n) for n in (peer.model.nq, peer.model.nv, peer.model.nv))
    for whole, own, base in zip((pq, pv, pa), to_pinocchio(q, v, a), (7, 6, 6), strict=True):
        whole[:base] = own[:base]
        whole[base:] = part.expand(own[base:], held=part.angles if base == 7 else None)
    torque = pin.rnea(peer.model, peer.data, pq, pv, pa)[6 + part.held[0]]
    assert abs(found.item() - torque) < 1e-10
    assert np.allclose(rotation(np.zeros(3)), np.eye(3))


@pytest.mark.skipif(not INSTALLED, reason="G1 needs example-robot-data")
@pytest.mark.parametrize("coordinates", [full_coordinates, mirrored_coordinates])
def test_the_torque_of_a_held_joint_counts_the_arms_that_move_on_it(coordinates) -> None:  # type: ignore[no-untyped-def]
    g1 = find_robot("g1")
    arms = ("shoulder_pitch_joint", "elbow_joint")
    robot = g1.changed(held={n: x for n, x in g1.held.items() if not n.endswith(arms)})
    part = welded(robot)
    pairs = mirrored_pairs(part.robot)
    assert pairs is not None and len(pairs) == 2  # legs and arms
    model = SymbolicModel(symmetrised(part.robot, pairs), part.loads)
    chosen = coordinates(model)
    q, v, a = motion(chosen.size)
    symbols = [ca.SX.sym(x, chosen.size) for x in "qva"]
    whole = [chosen.expand(x) for x in symbols]
    passed = model.inverse_dynamics(*whole, {}, chosen.limbs)[1]
    held = model.held_torques(*whole, passed, chosen.limbs, chosen.twins)
    found = evaluate([ca.vertcat(*held), *whole], symbols, [q, v, a])
    peer = ExactDynamics(robot)
    pq, pv, pa = (np.zeros(n) for n in (peer.model.nq, peer.model.nv, peer.model.nv))
    moved = to_pinocchio(*(x.ravel() for x in found[1:]))
    for each, own, base in zip((pq, pv, pa), moved, (7, 6, 6), strict=True):
        each[:base] = own[:base]
        each[base:] = part.expand(own[base:], held=part.angles if base == 7 else None)
    torque = pin.rnea(peer.model, peer.data, pq, pv, pa)[6:]
    links = model.frames(whole[0], chosen.limbs)
    known = [load for load in part.loads if load.link in links]
    waist = [robot.joints[load.joint].name for load in known if len(load.carried) == 2]
    assert waist == ["waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"]
    expected = torque[[load.joint for load in known]]
    assert found[0].ravel() == pytest.approx(expected, abs=5e-3 * np.abs(expected).max())
