"""Flights by conservation against the equations of motion, integrated step by step."""

import numpy as np
import pytest

from aloft.planner.models.exact_dynamics import ExactDynamics, JointMotion
from aloft.robots.description import find_robot


@pytest.mark.parametrize("seed", range(3))
def test_a_flight_is_that_of_the_equations_of_motion(seed: int) -> None:
    dynamics = ExactDynamics(find_robot("bruce"))
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=17) * 0.4, rng.normal(size=16)
    q[3:7] /= np.linalg.norm(q[3:7])
    end = q[7:] + 0.3 * rng.normal(size=10)
    joints = JointMotion(q[7:], end, v[6:], rng.normal(size=10), 0.1)
    coasted = dynamics.integrate(q, v, joints, np.zeros((4, 3)), 1e-3)
    # A force that is nearly nothing takes the other way, by accelerations.
    pushed = dynamics.integrate(q, v, joints, np.full((4, 3), 1e-14), 1e-3)
    assert len(coasted) == len(pushed) == 100
    for (time, place, speed), (other_time, other_place, other_speed) in zip(
        coasted, pushed, strict=True
    ):
        assert time == other_time
        np.testing.assert_allclose(place, other_place, atol=1e-9)
        np.testing.assert_allclose(speed, other_speed, atol=1e-8)
