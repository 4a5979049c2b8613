"""How robots of any kind are drawn."""

import warnings

import numpy as np
import pytest

from aloft.logs.viewing.robot_shapes import capsules, reach_of, shapes_of
from aloft.logs.viewing.scene_contacts import force_scale
from aloft.robots.description import Shape, find_robot

BRUCE = find_robot("bruce")


@pytest.mark.parametrize("count", [0, 1, 3, 4, 5])
def test_links_of_any_number_of_shapes_are_drawn_without_a_warning(count: int) -> None:
    shapes = [
        Shape(start=(0.0, 0.0, 0.0), end=(0.0, 0.1 * k, 0.1), radius=0.01) for k in range(count)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = capsules(shapes, 0x90A4AEFF)
    assert drawn.colors is None or len(drawn.colors.as_arrow_array()) == count


def test_a_link_without_shapes_has_bones_to_its_joints_and_contact_points() -> None:
    links = tuple(link.model_copy(update={"shapes": ()}) for link in BRUCE.links)
    bare = BRUCE.changed(links=links)
    foot = bare.feet[0]
    drawn = shapes_of(bare, bare.link(foot.link))
    points = [c.position for c in bare.contacts if c.foot == foot.name]
    assert [shape.end for shape in drawn] == points
    (base,) = [link for link in bare.links if link.name == bare.base]
    assert len(shapes_of(bare, base)) == sum(j.parent == bare.base for j in bare.joints)


def test_a_robot_is_measured_by_its_reach() -> None:
    assert 0.3 < reach_of(BRUCE) < 0.6
    weight = 9.81 * BRUCE.total_mass
    assert weight * force_scale(BRUCE) == pytest.approx(0.6 * reach_of(BRUCE), rel=0.03)
    assert np.isfinite(reach_of(BRUCE.changed(joints=(), links=BRUCE.links[:1])))
