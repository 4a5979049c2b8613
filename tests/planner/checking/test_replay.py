"""A plan's own equations, evaluated anew."""

from dataclasses import replace

import numpy as np
import pytest

from aloft.planner.checking.replay import midpoint_residuals
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.task.plan import PlannedJump
from aloft.robots.description import find_robot


def test_the_residual_is_what_a_force_is_wrong_by(by_hand_finely: PlannedJump) -> None:
    dynamics = ExactDynamics(find_robot("bruce"))
    gap, wrench = midpoint_residuals(by_hand_finely, dynamics)
    # Made with small steps of another method: fulfilled to second order only.
    assert gap.max() < 1e-2
    assert np.median(wrench) < 1.0
    pushed = by_hand_finely.contact_force.copy()
    pushed[20, 0] += [0.0, 7.0, 0.0]
    _, changed = midpoint_residuals(replace(by_hand_finely, contact_force=pushed), dynamics)
    assert changed[20] - wrench[20] == pytest.approx(7.0, abs=0.5)
    np.testing.assert_array_equal(np.delete(changed, 20), np.delete(wrench, 20))
