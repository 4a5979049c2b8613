"""Every term against Pinocchio's direct functions, numeric derivatives and Newton-Euler."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from aloft.blocks.control.dynamics import Dynamics, GravityCompensation
from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.pinocchio_model import build_pinocchio_model
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench
from aloft.runtime.testing.conformance import check_block, conformance_cases

ROBOT = find_robot("bruce")
SEEDS = range(8)


class State:
    """A random state of the robot, and Pinocchio's own model to compare with."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.model = build_pinocchio_model(ROBOT).model
        self.data = self.model.createData()
        limits = ROBOT.joint_limits
        self.q = np.empty(17)
        self.q[:3] = random.uniform(-0.5, 0.5, 3)
        quaternion = random.normal(size=4)
        self.q[3:7] = quaternion / np.linalg.norm(quaternion)
        self.q[7:] = random.uniform(limits[:, 0], limits[:, 1])
        self.v = random.normal(size=16) * np.repeat([1.0, 3.0, 5.0], [3, 3, 10])
        self.acceleration = random.normal(size=16) * 20.0

    def moved(self, duration):
        """The state after the acceleration has acted for a short time, to third order."""
        other = State.__new__(State)
        other.model, other.data = self.model, self.data
        step = self.v * duration + 0.5 * self.acceleration * duration**2
        other.q = pin.integrate(self.model, self.q, step)
        other.v = self.v + self.acceleration * duration
        return other


def evaluate(bench, state):
    rotation = pin.Quaternion(state.q[3:7]).toRotationMatrix()
    bench.set(
        "base",
        position=state.q[:3],
        orientation=state.q[3:7],
        linear_velocity=rotation @ state.v[:3],
        angular_velocity=state.v[3:6],
    )
    bench.set("joints", position=state.q[7:], velocity=state.v[6:])
    bench.step()
    return {name: array.copy() for name, array in bench.get("terms")}


@pytest.fixture(scope="module")
def bench():
    return BlockBench(Dynamics, robot="bruce")


def link_frame(state, foot_name, offset):
    """A frame of Pinocchio's at a point of the foot."""
    foot = next(f for f in ROBOT.feet if f.name == foot_name)
    name = next(j.name for j in ROBOT.joints if j.child == foot.link)
    joint = state.model.getJointId(name)
    label = f"probe {len(state.model.frames)}"
    frame = pin.Frame(label, joint, 0, pin.SE3(np.eye(3), np.array(offset)), pin.OP_FRAME)
    return state.model.addFrame(frame)


@pytest.mark.parametrize("seed", SEEDS)
def test_points_agree_with_frames_of_pinocchio(bench, seed):
    state = State(seed)
    probes = [link_frame(state, c.foot, c.position) for c in ROBOT.contacts]
    terms = evaluate(bench, state)
    data = state.model.createData()
    pin.forwardKinematics(state.model, data, state.q, state.v, np.zeros(16))
    pin.computeJointJacobians(state.model, data, state.q)
    pin.updateFramePlacements(state.model, data)
    aligned = pin.LOCAL_WORLD_ALIGNED
    for point, frame in enumerate(probes):
        jacobian = pin.getFrameJacobian(state.model, data, frame, aligned)[:3]
        drift = pin.getFrameClassicalAcceleration(state.model, data, frame, aligned).linear
        velocity = pin.getFrameVelocity(state.model, data, frame, aligned).linear
        assert np.abs(terms["contact_position"][point] - data.oMf[frame].translation).max() < 1e-13
        assert np.abs(terms["contact_jacobian"][point] - jacobian).max() < 1e-12
        assert np.abs(terms["contact_velocity"][point] - velocity).max() < 1e-11
        assert np.abs(terms["contact_drift"][point] - drift).max() < 1e-10


@pytest.mark.parametrize("seed", SEEDS)
def test_feet_agree_with_frames_of_pinocchio(bench, seed):
    state = State(seed)
    probes = [link_frame(state, foot.name, foot.sole) for foot in ROBOT.feet]
    terms = evaluate(bench, state)
    data = state.model.createData()
    pin.framesForwardKinematics(state.model, data, state.q)
    for foot, frame in enumerate(probes):
        assert np.abs(terms["foot_position"][foot] - data.oMf[frame].translation).max() < 1e-13
        assert np.abs(terms["foot_rotation"][foot] - data.oMf[frame].rotation).max() < 1e-13


@pytest.mark.parametrize("seed", SEEDS)
def test_inertia_has_the_coupled_rotors_and_momentum_does_not(bench, seed):
    state = State(seed)
    terms = evaluate(bench, state)
    state.model.armature = np.zeros(16)
    data = state.model.createData()
    bare = np.triu(pin.crba(state.model, data, state.q))
    bare = bare + np.triu(bare, 1).T
    rotors = terms["mass_matrix"] - bare
    b, inertia = ROBOT.joint_to_motor, ROBOT.profiles["koala"].rotor_inertia
    assert np.abs(rotors[6:, 6:] - inertia * b.T @ b).max() < 1e-12
    assert np.abs(rotors[:6]).max() < 1e-12
    assert inertia * (b.T @ b)[3, 4] > 0.001  # the knee's motor does turn with the ankle
    assert (
        np.abs(terms["centroidal_matrix"] - pin.ccrba(state.model, data, state.q, state.v)).max()
        < 1e-12
    )
    # The top of the bare inertia is the momentum at the base, seen from the base.
    rotation = pin.Quaternion(state.q[3:7]).toRotationMatrix()
    assert np.abs(rotation @ bare[:3] - terms["centroidal_matrix"][:3]).max() < 1e-12


@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_is_the_matrix_times_velocity(bench, seed):
    state = State(seed)
    terms = evaluate(bench, state)
    momentum = terms["centroidal_matrix"] @ terms["velocity"]
    assert np.abs(terms["velocity"] - state.v).max() < 1e-14
    assert np.abs(momentum[:3] - terms["linear_momentum"]).max() < 1e-12
    assert np.abs(momentum[3:] - terms["angular_momentum"]).max() < 1e-12
    assert np.abs(terms["com_velocity"] * ROBOT.total_mass - terms["linear_momentum"]).max() < 1e-12
    assert np.abs(pin.centerOfMass(state.model, state.data, state.q) - terms["com"]).max() < 1e-13


@pytest.mark.parametrize("seed", SEEDS)
def test_accelerations_and_momentum_rates_are_numeric_derivatives(bench, seed):
    state, step = State(seed), 1e-5
    terms = evaluate(bench, state)
    after, before = evaluate(bench, state.moved(step)), evaluate(bench, state.moved(-step))

    def rate(name):
        return (after[name] - before[name]) / (2.0 * step)

    assert np.abs(rate("com") - terms["com_velocity"]).max() < 1e-6
    assert np.abs(rate("contact_position") - terms["contact_velocity"]).max() < 1e-6
    acceleration = terms["contact_jacobian"] @ state.acceleration + terms["contact_drift"]
    assert np.abs(rate("contact_velocity") - acceleration).max() < 1e-4
    momentum_rate = terms["centroidal_matrix"] @ state.acceleration + terms["centroidal_drift"]
    measured = np.hstack([rate("linear_momentum"), rate("angular_momentum")])
    assert np.abs(measured - momentum_rate).max() < 1e-5


@pytest.mark.parametrize("seed", SEEDS)
def test_newton_and_euler_hold_with_contact_forces(bench, seed):
    """Forces through the equation of motion change the momentum by their sum and their moment."""
    state = State(seed)
    forces = np.random.default_rng(100 + seed).normal(size=(4, 3)) * 50.0
    torque = np.random.default_rng(200 + seed).normal(size=10) * 5.0
    terms = evaluate(bench, state)
    load = np.zeros(16)
    load[6:] = torque
    for jacobian, force in zip(terms["contact_jacobian"], forces, strict=True):
        load += jacobian.T @ force
    # Rotors do not carry momentum in this model, so the balance is that of the bare inertia.
    bare = terms["mass_matrix"].copy()
    b, inertia = ROBOT.joint_to_motor, ROBOT.profiles["koala"].rotor_inertia
    bare[6:, 6:] -= inertia * b.T @ b
    acceleration = np.linalg.solve(bare, load - terms["nonlinear_effects"])
    rate = terms["centroidal_matrix"] @ acceleration + terms["centroidal_drift"]
    weight = np.array([0.0, 0.0, -9.81 * ROBOT.total_mass])
    levers = terms["contact_position"] - terms["com"]
    assert np.abs(rate[:3] - (forces.sum(0) + weight)).max() < 1e-8
    assert np.abs(rate[3:] - np.cross(levers, forces).sum(0)).max() < 1e-8


def test_outputs_do_not_depend_on_what_came_before(bench):
    """The cached views of Pinocchio's memory still show the present tick after many."""
    first = evaluate(bench, State(0))
    for seed in range(1, 30):
        evaluate(bench, State(seed))
    again = evaluate(bench, State(0))
    fresh = evaluate(BlockBench(Dynamics, robot="bruce"), State(0))
    for name, array in first.items():
        assert np.array_equal(array, again[name]), name
        assert np.array_equal(array, fresh[name]), name


def test_orientation_need_not_be_exactly_of_unit_length(bench):
    state = State(3)
    terms = evaluate(bench, state)
    rotation = pin.Quaternion(state.q[3:7]).toRotationMatrix()
    bench.set("base", orientation=2.0 * state.q[3:7], linear_velocity=rotation @ state.v[:3])
    bench.step()
    assert np.abs(bench.get("terms").mass_matrix - terms["mass_matrix"]).max() < 1e-14


def test_the_rotors_are_those_of_the_profile_in_use():
    profiles = {
        "koala": ROBOT.profiles["koala"],
        "heavy": ROBOT.profiles["koala"].model_copy(update={"rotor_inertia": 0.1}),
    }
    robot = ROBOT.model_copy(update={"profiles": profiles})
    light, heavy = (
        BlockBench(Dynamics, robot=robot.with_profile(name)) for name in ("koala", "heavy")
    )
    for bench in (light, heavy):
        bench.set("base", orientation=[0.0, 0.0, 0.0, 1.0])
        bench.step()
    more = heavy.get("terms").mass_matrix - light.get("terms").mass_matrix
    matrix = ROBOT.joint_to_motor
    added = (0.1 - ROBOT.profiles["koala"].rotor_inertia) * matrix.T @ matrix
    np.testing.assert_allclose(more[6:, 6:], added, atol=1e-12)


def test_needs_a_robot():
    with pytest.raises(BlockError, match="it needs a robot, and the graph names none"):
        BlockBench(Dynamics, dimensions=dict(ROBOT.dimensions))


BALL = ROBOT.model_copy(
    update={
        "contacts": tuple(
            contact.model_copy(update={"radius": 0.05})
            for contact in ROBOT.contacts
            if contact.name.endswith("toe")
        )
    }
)
"""BRUCE on balls: one round contact point a foot."""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_foot_with_one_contact_point_rolls(seed):
    """The lowest point of the ball is below its centre, and what rests there is its material."""
    bench, state, step = BlockBench(Dynamics, robot=BALL), State(seed), 1e-5
    terms = evaluate(bench, state)
    after, before = evaluate(bench, state.moved(step)), evaluate(bench, state.moved(-step))
    for point, contact in enumerate(BALL.contacts):
        centre = link_frame(state, contact.foot, np.add(contact.position, [0, 0, 0.05]))
        data = state.model.createData()
        pin.forwardKinematics(state.model, data, state.q, state.v)
        pin.updateFramePlacements(state.model, data)
        below = np.array([0.0, 0.0, -0.05])
        motion = pin.getFrameVelocity(state.model, data, centre, pin.LOCAL_WORLD_ALIGNED)
        assert terms["contact_position"][point] == pytest.approx(
            data.oMf[centre].translation + below, abs=1e-12
        )
        assert terms["contact_velocity"][point] == pytest.approx(
            motion.linear + np.cross(motion.angular, below), abs=1e-10
        )
        assert terms["foot_position"][point] == pytest.approx(terms["contact_position"][point])
    assert terms["contact_jacobian"] @ state.v == pytest.approx(
        terms["contact_velocity"], abs=1e-11
    )
    rate = (after["contact_velocity"] - before["contact_velocity"]) / (2.0 * step)
    acceleration = terms["contact_jacobian"] @ state.acceleration + terms["contact_drift"]
    assert rate == pytest.approx(acceleration, abs=2e-4)


def test_the_model_has_the_mass_and_torso_at_the_input(bench):
    state = State(3)
    scale, offset = 1.07, np.array([0.006, -0.004, 0.008])
    bench.set("mass", mass=scale * ROBOT.total_mass, com_offset=offset)
    found = evaluate(bench, state)
    built = build_pinocchio_model(ROBOT)
    model = built.model
    for inertia in model.inertias:
        inertia.mass *= scale
        inertia.inertia = scale * inertia.inertia
    torso = model.inertias[model.getJointId("base")]
    torso.lever = torso.lever + offset
    data = model.createData()
    pin.computeAllTerms(model, data, state.q, state.v)
    np.testing.assert_allclose(found["mass_matrix"], data.M + built.rotor_coupling, atol=1e-12)
    np.testing.assert_allclose(found["nonlinear_effects"], data.nle, atol=1e-10)
    np.testing.assert_allclose(found["com"], data.com[0], atol=1e-12)
    np.testing.assert_allclose(found["centroidal_matrix"], data.Ag, atol=1e-12)
    assert found["mass_matrix"][0, 0] == pytest.approx(scale * ROBOT.total_mass)


def test_a_mass_of_zero_is_the_description(bench):
    state = State(4)
    bench.set("mass", mass=1.1 * ROBOT.total_mass, com_offset=0.01)
    evaluate(bench, state)
    bench.set("mass", mass=0.0, com_offset=0.0)
    found = evaluate(bench, state)
    pin.computeAllTerms(state.model, state.data, state.q, state.v)
    np.testing.assert_allclose(found["nonlinear_effects"], state.data.nle, atol=1e-10)


# GravityCompensation

LINK = {"mass": 2.0, "com": [0.3, 0.0, 0.0], "inertia": [0.01, 0.1, 0.1, 0, 0, 0]}
ARM: dict[str, Any] = {
    "name": "lift", "base": "mast", "base_joint": "fixed",
    "links": [{"name": name, **LINK} for name in ("mast", "carriage", "beam")],
    "joints": [
        {"name": "lift", "kind": "slide", "parent": "mast", "child": "carriage",
         "origin": [0, 0, 0], "axis": [0, 0, 1]},
        {"name": "hinge", "parent": "carriage", "child": "beam", "origin": [0, 0, 0],
         "axis": [0, 1, 0]},
    ],
    "transmission": {"motors": ["one", "two"], "joint_to_motor": [[1, 0], [0, 1]]},
    "profiles": {"only": {"peak_torque": 50, "corner_speed": 5, "no_load_speed": 9,
                          "continuous_torque": 20, "rotor_inertia": 0.01, "friction": 0.1,
                          "damping": 0.1}},
}  # fmt: skip
LIFT = RobotDescription.model_validate(ARM)


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.2, 3.0])
def test_a_beam_on_a_lift(angle: float) -> None:
    bench = BlockBench(GravityCompensation, robot=LIFT)
    bench.set("joints", position=[0.7, angle], velocity=[3.0, -5.0])
    bench.step()
    # A positive turn about y lowers the beam, so it is held by a negative torque.
    expected = [4.0 * 9.81, -2.0 * 9.81 * 0.3 * math.cos(angle)]
    np.testing.assert_allclose(bench.get("torque").torque, expected, atol=1e-12)


def test_a_floating_robot_is_refused() -> None:
    with pytest.raises(BlockError, match="needs a robot on a fixed base; bruce has a floating one"):
        BlockBench(GravityCompensation, robot="bruce")


@pytest.mark.parametrize("case", conformance_cases())
def test_conformance_of_gravity_compensation(case: str) -> None:
    check_block(GravityCompensation, robot=LIFT, cases=[case])
