"""The body sways about all axes over feet that stand still, and ends as it began."""

from __future__ import annotations

import numpy as np

from aloft.blocks.jumping.sway_reference import _plan
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


def test_all_directions_sway_over_standing_feet() -> None:
    table = _plan(
        ROBOT.model_dump_json(), (0.004, 0.01, 0.015), (0.1, 0.1, 0.1), 0.03, 1.0, 0.5, 4.0
    )
    columns = table.columns
    assert np.ptp(columns["foot_position"], axis=0).max() < 1e-4
    assert (np.ptp(columns["com"], axis=0) > 0.007).all()
    assert (np.ptp(columns["angular_velocity"], axis=0) > 0.5).all()
    assert np.abs(columns["com"][-1] - columns["com"][0]).max() < 1e-6
    assert np.abs(columns["joint_velocity"][-1]).max() < 0.05
