"""Motion under contact forces against the base's equations of motion, evaluated anew at every instant."""

import numpy as np
import pytest
from tests.robots.limbed_robots import quadruped

from aloft.planner.models.exact_dynamics import ExactDynamics, JointMotion
from aloft.robots.description import RobotDescription, find_robot

Array = np.ndarray


def rates(
    dynamics: ExactDynamics, joints: JointMotion, time: float, state: Array, force: Array
) -> Array:
    """The derivative of base position, quaternion and twist, by ``base_acceleration``."""
    angles, speeds, bends = joints.at(time)
    place, twist = state[:7].copy(), state[7:]
    place[3:7] /= np.linalg.norm(place[3:7])
    x, y, z, w = place[3:7]
    spin = 0.5 * np.array([[w, -z, y], [z, w, -x], [-y, x, w], [-x, -y, -z]])
    turn = dynamics.pin.Quaternion(place[3:7]).toRotationMatrix()
    bend = dynamics.base_acceleration(
        np.concatenate([place, angles]), np.concatenate([twist, speeds]), bends, force
    )
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


@pytest.mark.parametrize("robot", [find_robot("bruce"), quadruped()], ids=["soles", "balls"])
@pytest.mark.parametrize("seed", range(3))
def test_a_push_is_that_of_the_equations_of_motion(robot: RobotDescription, seed: int) -> None:
    dynamics, n = ExactDynamics(robot), len(robot.joints)
    assert bool(dynamics.balls) is (robot.name != "bruce")
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=7 + n) * 0.4, rng.normal(size=6 + n)
    q[3:7] = rng.normal(size=4)
    q[3:7] /= np.linalg.norm(q[3:7])
    joints = JointMotion(
        q[7:], q[7:] + 0.1 * rng.normal(size=n), v[6:], rng.normal(size=n), 0.05
    )  # fmt: skip
    force = rng.normal(size=(len(robot.contacts), 3)) * 30.0
    found = dynamics.integrate(q, v, joints, force, 0.025)
    wanted = stepped(dynamics, q, v, joints, force, 2)
    assert [time for time, _, _ in found] == pytest.approx([0.025, 0.05])
    for (_, place, speed), state in zip(found, wanted, strict=True):
        np.testing.assert_allclose(place[:7], state[:7], atol=1e-12)
        np.testing.assert_allclose(speed[:6], state[7:], atol=1e-10)
    np.testing.assert_allclose(found[-1][1][7:], joints.end, atol=1e-12)
