"""The body sways about all axes over feet that stand still, and ends as it began."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.jumping.sway_reference import Sway, _plan, usual_sway
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


@pytest.mark.long
def test_all_directions_sway_over_standing_feet() -> None:
    chosen = Sway((0.004, 0.01, 0.015), (0.1, 0.1, 0.1), 0.03, 1.0)
    table = _plan(ROBOT.model_dump_json(), chosen, 0.5, 4.0)
    columns = table.columns
    assert np.ptp(columns["foot_position"], axis=0).max() < 1e-4
    assert (np.ptp(columns["com"], axis=0) > 0.007).all()
    assert (np.ptp(columns["angular_velocity"], axis=0) > 0.5).all()
    assert np.abs(columns["com"][-1] - columns["com"][0]).max() < 1e-6
    assert np.abs(columns["joint_velocity"][-1]).max() < 0.05


def test_robots_sway_as_far_as_their_size_allows() -> None:
    assert usual_sway(ROBOT) == Sway((0.004, 0.01, 0.015), (0.12, 0.12, 0.15), 0.03, 1.0)
    tall, wide = usual_sway(find_robot("g1")), usual_sway(find_robot("go2"))
    assert tall.frequency == 0.7  # its centre of mass is twice as high
    assert tall.turn[1] < 0.09  # and its feet are short for that
    assert wide.turn == (0.12, 0.12, 0.15)
    assert wide.shift[0] > 3.0 * 0.004


@pytest.mark.long
@pytest.mark.parametrize("name", ["go2", "g1", "talos"])
def test_no_robot_passes_its_limits(name: str) -> None:
    robot = find_robot(name)
    _plan(robot.model_dump_json(), usual_sway(robot), 0.1, 3.0)
