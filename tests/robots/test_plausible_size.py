"""Size and mass of a robot go together, or it is said that they do not."""

from __future__ import annotations

import pytest

from aloft.robots.description import RobotDescription, find_robot
from aloft.robots.plausible_size import LEAST, MOST, ball_density, wrong_size
from aloft.studies.check_up import check_up


def scaled(robot: RobotDescription, places: float, masses: float) -> RobotDescription:
    """The robot with joints so many times as far apart, and links so many times as heavy."""
    joints = tuple(
        joint.model_copy(update={"origin": tuple(places * x for x in joint.origin)})
        for joint in robot.joints
    )
    links = tuple(
        link.model_copy(
            update={"mass": masses * link.mass, "inertia": tuple(masses * x for x in link.inertia)}
        )
        for link in robot.links
    )
    return robot.changed(joints=joints, links=links)


@pytest.mark.parametrize("name", ["bruce", "g1", "solo12", "simple_humanoid"])
def test_shipped_robots_are_far_from_both_ends(name: str) -> None:
    reach, density = ball_density(find_robot(name))
    assert 5.0 * LEAST < density < 0.02 * MOST
    assert 0.2 < reach < 4.0


def test_bruce_in_millimetres_or_grams_is_named() -> None:
    bruce = find_robot("bruce")
    assert wrong_size(bruce) == ()
    assert "lengths in millimetres" in wrong_size(scaled(bruce, 1e3, 1.0))[0]
    assert "masses in grams" in wrong_size(scaled(bruce, 1.0, 1e3))[0]
    assert wrong_size(scaled(bruce, 1.5, 2.0)) == ()


def test_a_link_denser_than_any_material_is_named() -> None:
    bruce = find_robot("bruce")
    links = tuple(
        link.model_copy(update={"mass": 1000.0 * link.mass}) if link.name == "left_calf" else link
        for link in bruce.links
    )
    assert sum(link.name == "left_calf" for link in links) == 1
    (said,) = wrong_size(bruce.changed(links=links))
    assert said.startswith("the inertia of left_calf (") and "denser than any material" in said


def test_the_check_up_names_a_joint_that_is_nowhere_near_its_links() -> None:
    bruce = find_robot("bruce")
    assert not any(
        each["part"].startswith("joint left_knee") for each in check_up(bruce)["remarks"]
    )
    away = tuple(
        joint.model_copy(update={"origin": (0.0, 0.0, -1.75)})
        if joint.name == "left_knee"
        else joint
        for joint in bruce.joints
    )
    remarks = [
        each
        for each in check_up(bruce.changed(joints=away))["remarks"]
        if each["part"] == "joint left_knee"
    ]
    assert "from the middle of left_thigh's shapes" in remarks[0]["found"]
