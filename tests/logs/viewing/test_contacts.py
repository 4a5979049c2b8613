"""The load on each foot, and the peak of a landing, as the viewer shows them."""

import numpy as np

from aloft.logs.viewing.contacts import LandingPeaks, loads_on_feet
from aloft.robots.description import find_robot

BRUCE = find_robot("bruce")


def test_the_points_of_a_foot_are_added_up() -> None:
    force = np.zeros((2, len(BRUCE.contacts), 3))
    force[1, :, 2] = [1.0, 2.0, 4.0, 8.0]
    force[1, :, 0] = 100.0  # what is not vertical does not count
    loads = loads_on_feet(BRUCE, force)
    first = [k == 0 for k in BRUCE.foot_of_contact()]
    assert loads.shape == (2, 2)
    np.testing.assert_array_equal(loads[0], 0.0)
    assert loads[1, 0] == np.array([1.0, 2.0, 4.0, 8.0])[first].sum()
    assert loads[1].sum() == 15.0


def test_the_peak_of_a_landing_is_told_with_its_foot_and_tick() -> None:
    force = np.zeros((60, len(BRUCE.contacts), 3))
    other = BRUCE.foot_of_contact().index(1)
    force[12, other, 2] = 10.0 * BRUCE.weight
    force[50, other, 2] = 20.0 * BRUCE.weight  # long after the landing
    ticks = np.arange(100, 160)
    peaks = LandingPeaks(BRUCE, 20)
    # the window goes over the border of two batches
    events = peaks.add(ticks[:20], force[:20], [110]) + peaks.add(ticks[20:], force[20:], [])
    newtons = f"{10.0 * BRUCE.weight:.0f}"
    text = f"landing: {newtons} N on {BRUCE.feet[1].name}, 10.0 times the weight"
    assert events == [(112, text)]
    assert LandingPeaks(BRUCE, 20).add(ticks, force, []) == []
