"""Exact dynamics: against Pinocchio's equations of motion, a free fall, and conservation.

Motion with and without contact forces against the base's equations of motion, integrated step by step.
"""

import numpy as np
import pytest
from tests.planner.one_interval import JointMotion, integrate
from tests.robots.limbed_robots import quadruped

from aloft.mathematics.compiling.compile_calls import run_compiled
from aloft.mathematics.whole_body_motion import velocities_at_points
from aloft.planner.models.exact_dynamics import ExactDynamics, rotation_between, states_between
from aloft.robots.description import RobotDescription, find_robot


@pytest.fixture(scope="module")
def dynamics() -> ExactDynamics:
    return ExactDynamics(find_robot("bruce"))


def random_state(dynamics: ExactDynamics, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=17) * 0.4
    q[3:7] = rng.normal(size=4)
    q[3:7] /= np.linalg.norm(q[3:7])
    return q, rng.normal(size=16)


@pytest.mark.parametrize("seed", range(5))
def test_base_and_torque_solve_the_whole_equations_of_motion(
    dynamics: ExactDynamics, seed: int
) -> None:
    q, v = random_state(dynamics, seed)
    rng = np.random.default_rng(seed + 100)
    torque, force = rng.normal(size=10), rng.normal(size=(4, 3)) * 20
    bias = dynamics.pin.rnea(dynamics.model, dynamics.data, q, v, np.zeros(16))
    pushed = dynamics.contact_jacobians(q)[1].T @ force.ravel()
    right = np.concatenate([np.zeros(6), torque]) + pushed - bias
    whole = np.linalg.solve(dynamics.mass_matrix(q), right)
    base = dynamics.motion(q[None], v[None], whole[None, 6:], force[None]).base[0]
    np.testing.assert_allclose(base, whole[:6], atol=1e-11)
    found = dynamics.joint_torque(q, v, whole[6:], force)
    np.testing.assert_allclose(found, torque, atol=1e-11)


def test_in_flight_the_centre_falls_and_the_angular_momentum_stays(
    dynamics: ExactDynamics,
) -> None:
    q, v = random_state(dynamics, 7)
    end = q[7:] + np.random.default_rng(1).normal(size=10) * 0.3
    joints = JointMotion(q[7:], end, v[6:], np.zeros(10), 0.3)
    com, speed, momentum = dynamics.centroidal(q, v)
    last_time, last_q, last_v = integrate(dynamics, q, v, joints, np.zeros((4, 3)), 1e-3)[-1]
    assert last_time == pytest.approx(0.3)
    after, after_speed, after_momentum = dynamics.centroidal(last_q, last_v)
    gravity = np.array([0.0, 0.0, -9.81])
    np.testing.assert_allclose(after_speed, speed + 0.3 * gravity, atol=1e-9)
    np.testing.assert_allclose(after, com + 0.3 * speed + 0.045 * gravity, atol=1e-9)
    np.testing.assert_allclose(after_momentum, momentum, atol=1e-9)
    np.testing.assert_allclose(last_q[7:], end, atol=1e-12)


def test_an_impulse_changes_the_momentum_by_itself(dynamics: ExactDynamics) -> None:
    q, v = random_state(dynamics, 3)
    impulse = np.random.default_rng(5).normal(size=(4, 3))
    behind, motors = dynamics.velocity_after_impact(q, v, impulse)
    np.testing.assert_array_equal(motors, np.zeros(10))
    com, before, spin = dynamics.centroidal(q, v)
    _, after, spin_after = dynamics.centroidal(q, behind)
    np.testing.assert_allclose(dynamics.mass * (after - before), impulse.sum(axis=0), atol=1e-10)
    moment = np.cross(dynamics.points(q) - com, impulse).sum(axis=0)
    np.testing.assert_allclose(spin_after - spin, moment, atol=1e-10)


def test_held_joints_keep_their_speed_by_their_motors_impulse(dynamics: ExactDynamics) -> None:
    q, v = random_state(dynamics, 4)
    impulse = np.random.default_rng(6).normal(size=(4, 3))
    held = np.arange(10) % 3 == 0
    behind, motors = dynamics.velocity_after_impact(q, v, impulse, held)
    np.testing.assert_array_equal(behind[6:][held], v[6:][held])
    assert np.all(motors[~held] == 0.0)
    pushed = dynamics.contact_jacobians(q)[1].T @ impulse.ravel()
    pushed[6:] += motors
    np.testing.assert_allclose(dynamics.mass_matrix(q) @ (behind - v), pushed, atol=1e-10)


def test_the_joints_cubic_meets_both_ends_and_a_constant_acceleration() -> None:
    start, speed, bend, t = np.array([0.3]), np.array([-2.0]), np.array([40.0]), 0.02
    motion = JointMotion(
        start, start + t * speed + 0.5 * t**2 * bend, speed, speed + t * bend, t
    )  # fmt: skip
    position, velocity, acceleration = motion.at(0.013)
    assert position[0] == pytest.approx(0.3 - 2.0 * 0.013 + 20.0 * 0.013**2, abs=1e-14)
    assert velocity[0] == pytest.approx(-2.0 + 40.0 * 0.013, abs=1e-11)
    assert acceleration[0] == pytest.approx(40.0, rel=1e-9)


def test_states_between_knots_have_the_bits_of_whole_arrays() -> None:
    rng, knots, n = np.random.default_rng(6), 12, 300
    place, rate, time = (
        rng.normal(size=(knots, 7)),
        rng.normal(size=(knots, 7)),
        np.arange(12) * 0.1,
    )
    time[5:] += 0.013 - 0.1  # at an impact two knots have one time
    time[6] = time[5]
    place[:, 2], rate[:, 2], knot = 0.0, -0.0, rng.integers(0, knots - 1, n)
    length = (time[knot + 1] - time[knot])[:, None]
    passed = rng.random(n) * length[:, 0]
    length[length == 0.0] = 1.0
    plain = JointMotion(place[knot], place[knot + 1], rate[knot], rate[knot + 1], length)
    found = states_between(place, rate, time, knot, passed)
    wanted = plain.at(passed[:, None])
    assert [each.tobytes() for each in found] == [each.tobytes() for each in wanted]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 3.0])
def test_rotation_between(angle: float) -> None:
    first = np.array([0.0, 0.0, 0.0, 1.0])
    second = np.array([np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2)])
    assert rotation_between(first, second) == pytest.approx(angle, abs=1e-15)
    assert rotation_between(first, -second) == pytest.approx(angle, abs=1e-15)


@pytest.mark.parametrize("robot", [find_robot("bruce"), quadruped()], ids=["soles", "balls"])
def test_many_states_at_once_are_those_of_pinocchio(robot: RobotDescription) -> None:
    dynamics, n, rng = ExactDynamics(robot), len(robot.joints), np.random.default_rng(3)
    q, v = rng.normal(size=(6, 7 + n)) * 0.4, rng.normal(size=(6, 6 + n))
    q[:, 3:7] = rng.normal(size=(6, 4))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]
    bend, force = rng.normal(size=(6, 6 + n)), rng.normal(size=(6, len(robot.contacts), 3)) * 20.0
    terms = dynamics.motion(q, v, bend[:, 6:], force)
    left = dynamics.base_residual(q, v, bend, force)
    feet = dynamics.feet(q, v)
    for i in range(6):
        for found, wanted in zip(
            (terms.com, terms.com_velocity, terms.momentum),
            dynamics.centroidal(q[i], v[i]),
            strict=True,
        ):
            np.testing.assert_allclose(found[i], wanted, atol=1e-12)
        points, jacobian = dynamics.contact_jacobians(q[i])
        soles, heading = dynamics.soles(q[i])
        np.testing.assert_allclose(terms.points[i], np.vstack([points, soles]), atol=1e-13)
        for name in ("com", "com_velocity", "momentum"):
            found, wanted = getattr(feet, name)[i], getattr(terms, name)[i]
            np.testing.assert_allclose(found, wanted, atol=1e-12)
        np.testing.assert_allclose(feet.soles[i], soles, atol=1e-13)
        np.testing.assert_allclose(feet.yaw[i], heading, atol=1e-12)
        speeds = (jacobian @ v[i]).reshape(-1, 3)
        np.testing.assert_allclose(terms.point_velocity[i, : len(points)], speeds, atol=1e-12)
        pushed = jacobian.T @ force[i].ravel()
        moved = dynamics.pin.rnea(dynamics.model, dynamics.data, q[i], v[i], bend[i])
        np.testing.assert_allclose(left[i], (moved - pushed)[:6], atol=1e-10)
        ahead = terms.ahead[i, len(points) :]
        if not dynamics.balls:
            np.testing.assert_allclose(
                feet.sole_velocity[i], terms.point_velocity[i, len(points) :], atol=1e-12
            )
            np.testing.assert_allclose(np.arctan2(ahead[:, 1], ahead[:, 0]), heading, atol=1e-12)


def test_speeds_of_points_have_the_bits_of_whole_jacobians() -> None:
    rng, count, points, size = np.random.default_rng(4), 50, 3, 21
    columns, velocity = rng.normal(size=(count, size, 6)), rng.normal(size=(count, size))
    places, moves = rng.normal(size=(count, points, 3)), rng.random((points, size)) < 0.6
    found = np.empty((count, points, 6))
    run_compiled(velocities_at_points, columns, moves, places, velocity, np.empty((6, size)), found)
    for point in range(points):
        x, y, z = places[:, point].T[:, :, None]
        a, b, c, p, q, r = np.moveaxis(columns, -1, 0)
        at_point = a - (y * r - z * q), b - (z * p - x * r), c - (x * q - y * p), p, q, r
        jacobian = np.where(moves[point], np.stack(at_point, axis=1), 0.0)
        assert (found[:, point] == (jacobian * velocity[:, None]).sum(axis=-1)).all()


Array = np.ndarray


def rates(
    dynamics: ExactDynamics, joints: JointMotion, time: float, state: Array, force: Array
) -> Array:
    """The derivative of base position, quaternion and twist, by Pinocchio's equations of motion."""
    angles, speeds, bends = joints.at(time)
    place, twist = state[:7].copy(), state[7:]
    place[3:7] /= np.linalg.norm(place[3:7])
    x, y, z, w = place[3:7]
    spin = 0.5 * np.array([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]])
    turn = dynamics.pin.Quaternion(place[3:7]).toRotationMatrix()
    pin, q, v = dynamics.pin, np.concatenate([place, angles]), np.concatenate([twist, speeds])
    pushed = dynamics.contact_jacobians(q)[1].T @ force.ravel()
    known = np.concatenate([np.zeros(6), bends])
    bias = pin.rnea(dynamics.model, dynamics.data, q, v, known)[:6]
    inertia = pin.crba(dynamics.model, dynamics.data, q)[:6, :6]
    bend = np.linalg.solve(inertia, pushed[:6] - bias)
    return np.concatenate([turn @ twist[:3], spin @ twist[3:6], bend])


def stepped(
    dynamics: ExactDynamics, q: Array, v: Array, joints: JointMotion, force: Array, count: int
) -> list[Array]:
    """The base's state after every step of Runge and Kutta's method, each as the book has it."""
    h, state, found = joints.duration / count, np.concatenate([q[:7], v[:6]]), []
    for i in range(count):
        t = i * h
        a = rates(dynamics, joints, t, state, force)
        b = rates(dynamics, joints, t + 0.5 * h, state + 0.5 * h * a, force)
        c = rates(dynamics, joints, t + 0.5 * h, state + 0.5 * h * b, force)
        d = rates(dynamics, joints, t + h, state + h * c, force)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        state[3:7] /= np.linalg.norm(state[3:7])
        found.append(state)
    return found


@pytest.mark.parametrize("newtons", [0.0, 30.0])
@pytest.mark.parametrize("robot", [find_robot("bruce"), quadruped()], ids=["soles", "balls"])
@pytest.mark.parametrize("seed", range(2))
def test_motion_is_that_of_the_equations_of_motion(
    robot: RobotDescription, seed: int, newtons: float
) -> None:
    dynamics, n = ExactDynamics(robot), len(robot.joints)
    assert bool(dynamics.balls) is (robot.name != "bruce")
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=7 + n) * 0.4, rng.normal(size=6 + n)
    q[3:7] = rng.normal(size=4)
    q[3:7] /= np.linalg.norm(q[3:7])
    joints = JointMotion(
        q[7:], q[7:] + 0.1 * rng.normal(size=n), v[6:], rng.normal(size=n), 0.05
    )  # fmt: skip
    force = rng.normal(size=(len(robot.contacts), 3)) * newtons
    found = integrate(dynamics, q, v, joints, force, 0.001)
    wanted = stepped(dynamics, q, v, joints, force, 50)
    assert [time for time, _, _ in found] == pytest.approx([0.001 * (i + 1) for i in range(50)])
    for (_, place, speed), state in zip(found, wanted, strict=True):
        np.testing.assert_allclose(place[:7], state[:7], atol=1e-8)
        np.testing.assert_allclose(speed[:6], state[7:], atol=1e-6)
    np.testing.assert_allclose(found[-1][1][7:], joints.end, atol=1e-12)


def test_two_steps_over_an_interval_are_exact_enough() -> None:
    """As the check takes them under contact forces."""
    robot = find_robot("bruce")
    dynamics, rng = ExactDynamics(robot), np.random.default_rng(4)
    q = np.concatenate([[0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 1.0], robot.standing_position])
    v = 0.5 * rng.normal(size=16)
    joints = JointMotion(q[7:], q[7:] + 0.025 * v[6:], v[6:], v[6:], 0.025)
    force = np.tile([2.0, 1.0, 15.0], (4, 1))
    _, place, speed = integrate(dynamics, q, v, joints, force, 0.0125)[-1]
    _, exact, moving = integrate(dynamics, q, v, joints, force, 0.0005)[-1]
    np.testing.assert_allclose(place, exact, atol=1e-6)
    np.testing.assert_allclose(speed, moving, atol=1e-4)


def test_what_one_call_gave_stays_as_it_is_in_the_next(dynamics: ExactDynamics) -> None:
    """The memory of calls is kept, with and without forces and accelerations."""
    (q, v), (other, moving) = (random_state(dynamics, seed) for seed in (11, 12))
    bend, force = np.ones((1, 10)), np.full((1, 4, 3), 5.0)
    first = dynamics.motion(q[None], v[None], bend, force)
    before = [array.copy() for array in first]
    dynamics.motion(other[None], moving[None], 2.0 * bend, 2.0 * force)
    bare = dynamics.motion(q[None], v[None])
    for found, expected in zip(first, before, strict=True):
        np.testing.assert_array_equal(found, expected)
    still = dynamics.motion(q[None], v[None], np.zeros((1, 10)), np.zeros((1, 4, 3)))
    for found, expected in zip(bare, still, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.abs(bare.torque - first.torque).max() > 1e-3
