"""Values per joint: by name or pattern, checked against the robot, never by position."""

import numpy as np
import pytest
from pydantic import ValidationError

from aloft.robots.description import find_robot
from aloft.runtime.language.parameters import Parameters, live_parameter
from aloft.runtime.language.per_joint import PerJoint, by_name

BRUCE = find_robot("bruce")
NAMES = [joint.name for joint in BRUCE.joints]


class Springs(Parameters):
    stiffness: PerJoint = live_parameter(40.0, unit="N m/rad", ge=0.0, lt=1e3, text="of a joint")
    damping: PerJoint = live_parameter({"*": 1.0, "*_ankle": 0.5}, text="of a joint")


def test_a_number_counts_for_all_joints() -> None:
    assert Springs().stiffness.resolve(BRUCE).tolist() == [40.0] * len(NAMES)
    assert Springs(stiffness=3).stiffness.resolve(BRUCE).dtype == np.float64


def test_later_entries_win() -> None:
    found = Springs(stiffness={"*": 40, "*_knee": 60, "left_knee": 65, "left_ank*": 5}).stiffness
    values = dict(zip(NAMES, found.resolve(BRUCE).tolist(), strict=True))
    assert values["right_knee"] == 60 and values["left_knee"] == 65
    assert values["left_ankle"] == 5 and values["right_ankle"] == 40
    overruled = Springs(stiffness={"left_knee": 65, "*": 40}).stiffness
    assert set(overruled.resolve(BRUCE).tolist()) == {40.0}


def test_quantities_and_defaults() -> None:
    assert Springs(stiffness={"*": "0.04 kN m/rad"}).stiffness.resolve(BRUCE)[0] == 40.0
    assert Springs().damping.resolve(BRUCE)[NAMES.index("left_ankle")] == 0.5


def test_what_is_written_comes_back() -> None:
    for value in (3.0, {"*": 1.0, "left_*": 2.0}):
        params = Springs(stiffness=value)
        data = params.model_dump(mode="json", round_trip=True)
        assert data["stiffness"] == value
        assert Springs.model_validate(data) == params


def test_patterns_and_joints_that_do_not_match() -> None:
    found = Springs(stiffness={"*_kne": 1.0, "left_*": 2.0, "*_knee": 3.0}).stiffness
    assert found.unmatched_patterns(BRUCE) == ("*_kne",)
    assert found.joints_without_value(BRUCE) == tuple(
        name for name in NAMES if name.startswith("right_") and not name.endswith("_knee")
    )
    with pytest.raises(LookupError, match=r"bruce has no joint \*_kne"):
        found.resolve(BRUCE)
    with pytest.raises(LookupError, match="no value for bruce's right_hip_yaw, "):
        Springs(stiffness={"left_*": 2.0}).stiffness.resolve(BRUCE)


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        ([1.0] * 10, "by_position"),
        ((1.0, 2.0), "by_position"),
        (-1.0, "greater_than_equal"),
        ({"*": 1.0, "*_knee": -1.0}, "greater_than_equal"),
        ({"*": 1e3}, "less_than"),
        (True, "float_type"),
        ({"*": True}, "float_type"),
        ({"*": [1.0]}, "float_type"),
        ({"*": float("nan")}, "finite_number"),
        ("soft", "float_type"),
    ],
)
def test_what_is_refused(value: object, kind: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Springs.model_validate({"stiffness": value})
    assert kind in {error["type"] for error in caught.value.errors()}


def test_what_a_list_may_have_meant() -> None:
    assert by_name([1, 2, 3, 4, 5], BRUCE) == {
        "*_hip_yaw": 1, "*_hip_pitch": 2, "*_hip_roll": 3, "*_knee": 4, "*_ankle": 5,
    }  # fmt: skip
    assert by_name(range(10), BRUCE) == dict(zip(NAMES, range(10), strict=True))
    assert by_name([1, 2], BRUCE) == {}
    assert by_name([1, 2, 3, 4, 5], BRUCE.model_copy(update={"feet": ()})) == {}
    # a leg of four joints beside one of five: neither length is that of all
    shorter = BRUCE.feet[0].model_copy(update={"link": "right_calf"})
    uneven = BRUCE.model_copy(update={"feet": (shorter, *BRUCE.feet[1:])})
    assert by_name([1, 2, 3, 4, 5], uneven) == {} and by_name([1, 2, 3, 4], uneven) == {}


def test_a_pattern_that_would_match_more_is_not_proposed() -> None:
    """With a third knee elsewhere, the two of the legs are named one by one."""
    extra = BRUCE.joints[0].model_copy(update={"name": "tail_knee"})
    robot = BRUCE.model_copy(update={"joints": (*BRUCE.joints, extra)})
    named = by_name([1, 2, 3, 4, 5], robot)
    assert "*_knee" not in named
    assert named["left_knee"] == named["right_knee"] == 4
