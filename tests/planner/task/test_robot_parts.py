"""Toes, knees and the room of the joints, from a robot's description alone."""

import numpy as np
import pytest
from tests.robots.limbed_robots import quadruped

from aloft.planner.task.robot_parts import knee_limits, least_distance_to_limits, word_of_toes
from aloft.robots.description import find_robot

BRUCE = find_robot("bruce")


def test_toes_are_the_front_points_of_soles_by_their_common_word() -> None:
    assert word_of_toes(BRUCE) == "toe"
    assert word_of_toes(quadruped()) == "", "feet of one point are no soles"


def test_front_points_that_have_no_word_of_their_own_are_no_toes() -> None:
    renamed = tuple(
        point.model_copy(update={"name": point.name.replace("toe", "heel") + "_" * k})
        for k, point in enumerate(BRUCE.contacts)
    )
    assert word_of_toes(BRUCE.changed(contacts=renamed)) == ""


def test_the_knee_is_what_bends_the_leg_most() -> None:
    assert knee_limits(BRUCE, 0.4) == {"knee": (-2.1, -0.4)}
    standing = BRUCE.standing_position[[joint.name for joint in BRUCE.joints].index("left_knee")]
    nearly = knee_limits(BRUCE, 2.0)["knee"]
    assert nearly[1] == pytest.approx(0.8 * standing, abs=0.01), "no more than where it stands"


def test_the_room_is_that_of_the_standing_joint_nearest_to_a_limit() -> None:
    angles, limits = BRUCE.standing_position, BRUCE.joint_limits
    nearest = np.minimum(angles - limits[:, 0], limits[:, 1] - angles).min()
    assert least_distance_to_limits(BRUCE) == pytest.approx(nearest)
