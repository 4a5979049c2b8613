"""Plans of hops: reach, weights of the interpolation, and the file."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from aloft.extensions.hopping.planner.hop_plans import samples_of_hops, shipped_path
from aloft.extensions.hopping.planner.hop_request import HopReach, HopRequest, StepReach
from aloft.extensions.hopping.planner.make_samples import (
    plan_level_hops,
    reach_for,
    reached,
    request,
)
from aloft.extensions.hopping.planner.plan_samples import read_samples, write_samples
from aloft.planner.task.files import PlanError
from aloft.planner.task.plan import ARRAYS, PlanFileError
from aloft.robots.description import find_robot
from aloft.studies.check_up import with_stronger_motors

SAMPLES = samples_of_hops(find_robot("bruce"))
STEPS = samples_of_hops(find_robot("bruce"), steps=True)
REACH = HopReach(ahead=0.32, back=0.1, aside=0.3, turn=0.87, rise=0.09)
UP = StepReach(least=0.12, ahead=0.32, aside=0.1, turn=0.35, up=0.06, down=0.04, rise=0.09)


def test_a_request_within_reach_is_left_and_another_comes_to_the_edge() -> None:
    near = HopRequest(0.2, 0.1, -0.3)
    assert REACH.nearest(near) == near
    far = REACH.nearest(HopRequest(3.0, 0.0, 2.0))
    assert far == pytest.approx((REACH.ahead, 0.0, REACH.turn, 0.0))
    back = REACH.nearest(HopRequest(-1.0, 1.0, 0.0))
    assert (back.ahead / REACH.back) ** 2 + (back.aside / REACH.aside) ** 2 == pytest.approx(1.0)
    assert back.ahead == pytest.approx(-back.aside)
    level = HopRequest(-0.05, 0.2, 0.0, 0.004)
    assert level.level and REACH.nearest(level) == level, "landing takes so little without a plan"


def test_a_jump_up_goes_ahead_and_not_too_high() -> None:
    near = HopRequest(0.2, 0.05, -0.3, 0.05)
    assert UP.nearest(near) == near
    assert UP.nearest(HopRequest(-0.2, 0.0, 0.0, -0.2)) == pytest.approx((0.12, 0.0, 0.0, -0.04))
    assert REACH.nearest(HopRequest(0.2, 0.0, 0.0, 0.2)) == HopRequest(0.2, 0.0, 0.0)


def test_reach_is_where_nine_of_ten_requests_have_plans() -> None:
    requests = [request(index, REACH) for index in range(96)]
    assert reached(REACH, requests, requests) == REACH
    near = [one for one in requests if REACH.share(one) < 0.5]
    found = reached(REACH, requests, near)
    assert 0.3 < found.ahead / REACH.ahead < 0.6
    assert found.rise == REACH.rise
    within = [one for one in requests if found.share(one) <= 1.0]
    assert sum(one in near for one in within) >= 0.9 * len(within)


def test_reach_is_told_by_the_file_and_asked_for_by_size() -> None:
    assert SAMPLES.reach == REACH == reach_for(find_robot("bruce"))
    other = find_robot("go2")
    assert reach_for(other).ahead < REACH.ahead, "it stands lower"
    assert samples_of_hops(other).reach != reach_for(other), "more was asked for"
    assert reach_for(other).back == reach_for(other).ahead, "balls have no heels"


def test_a_robot_without_a_jump_on_the_spot_is_refused_at_once() -> None:
    weak = with_stronger_motors(find_robot("go2"), 0.2)
    asked = []
    with pytest.raises(
        PlanError, match=r"go2 has no valid plan of a jump on the spot, 5.0 cm high"
    ):
        plan_level_hops(weak, reach_for(weak), lambda wanted, valid: asked.append(wanted), 4)
    assert asked == 3 * [HopRequest(0.0, 0.0, 0.0)]


def test_weights_reproduce_every_linear_function() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        wanted = HopRequest(*(rng.uniform(-1.0, 1.0, 3) * [0.2, 0.2, 0.7]).tolist())
        weights = SAMPLES.weights(wanted)
        assert weights.sum() == pytest.approx(1.0)
        assert weights @ SAMPLES.requests == pytest.approx(np.array(wanted), abs=1e-9)
        up = HopRequest(0.2 + wanted.aside / 2, wanted.ahead / 2, 0.3 * wanted.turn, 0.03)
        assert STEPS.weights(up) @ STEPS.requests == pytest.approx(np.array(up), abs=1e-9)


def test_an_interpolated_motion_lands_about_where_it_should() -> None:
    plan = SAMPLES.interpolated(HopRequest(0.15, -0.05, 0.2))
    assert np.linalg.norm(plan.position[:, 3:7], axis=1) == pytest.approx(1.0)
    assert plan.com[-1, :2] == pytest.approx([0.15, -0.05], abs=0.02)


def test_the_nearest_plan_is_one_within_reach() -> None:
    row = SAMPLES.nearest(HopRequest(-0.3, 0.0, 0.0))
    found = HopRequest(*SAMPLES.requests[row].tolist())
    assert SAMPLES.reach.nearest(found) == found


def members(path: Path) -> dict[str, bytes]:
    """The files in an archive; its own bytes depend on the version of Python."""
    with ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("steps", [False, True])
def test_the_file_gives_what_was_written(tmp_path: Path, steps: bool) -> None:
    samples = STEPS if steps else SAMPLES
    path = write_samples(tmp_path / "hops.npz", samples)
    again = read_samples(path)
    assert members(path) == members(shipped_path("bruce", steps=steps))
    for name in ARRAYS:
        np.testing.assert_array_equal(again.arrays[name], samples.arrays[name])


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PlanFileError, match="cannot read"):
        read_samples(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no plans")
    with pytest.raises(PlanFileError, match="has no plans of hops"):
        read_samples(tmp_path / "text.npz")
    np.savez(tmp_path / "other.npz", header=np.array('{"format": "another"}'))
    with pytest.raises(PlanFileError, match="is of format 'another', expected 'aloft hop plans 3'"):
        read_samples(tmp_path / "other.npz")
