"""What links look like: boxes, turned parts, meshes, colours."""

from pathlib import Path

import numpy as np
import pytest

from aloft.robots.description import Box, RobotError, TurnedShape, find_robot, read_description
from aloft.robots.kinematics import link_poses
from aloft.robots.surfaces import (
    MOST_TRIANGLES,
    Surface,
    box_surface,
    joined,
    normals,
    robot_surfaces,
    turned_surface,
)

from .example_robots import needs_robots

BRUCE = find_robot("bruce")


def volume(surface: Surface) -> float:
    """That which a closed surface holds, positive where its triangles face outwards [m^3]."""
    a, b, c = (surface.corners[surface.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


def test_a_box_has_its_size_and_faces_outwards() -> None:
    surface = box_surface(Box(size=(0.1, 0.2, 0.3), position=(1.0, 0.0, 0.0)))
    assert np.ptp(surface.corners, axis=0) == pytest.approx([0.1, 0.2, 0.3])
    assert surface.corners.mean(axis=0) == pytest.approx([1.0, 0.0, 0.0])
    assert volume(surface) == pytest.approx(0.1 * 0.2 * 0.3)
    turned = box_surface(Box(size=(0.1, 0.2, 0.3), orientation=(0, 0, 0.5**0.5, 0.5**0.5)))
    assert np.ptp(turned.corners, axis=0) == pytest.approx([0.2, 0.1, 0.3])


@pytest.mark.parametrize("radius", [0.01, 0.05])
def test_a_rounded_box_keeps_its_size_and_loses_its_corners(radius: float) -> None:
    surface = box_surface(Box(size=(0.1, 0.2, 0.3), round=radius, color="#0a0b0c"))
    assert np.ptp(surface.corners, axis=0) == pytest.approx([0.1, 0.2, 0.3])
    assert 0.5 * 0.006 < volume(surface) < 0.006 and surface.color == 0x0A0B0C
    inner = np.clip(surface.corners, *(s * (np.array([0.05, 0.1, 0.15]) - radius) for s in (-1, 1)))
    away = np.linalg.norm(surface.corners - inner, axis=1)
    assert away == pytest.approx(radius)
    assert (surface.corners * normals(surface)).sum(axis=1).min() > 0.0


@pytest.mark.parametrize("profile", [((0.05, 0.0), (0.05, 0.2)), ((0.05, 0.2), (0.05, 0.0))])
def test_a_turned_part_is_closed_and_lies_along_its_axis(profile) -> None:
    surface = turned_surface(TurnedShape(profile=profile, axis=(0, 2, 0), position=(0, 1, 0)))
    assert surface.corners[:, 1].min() == pytest.approx(1.0)
    assert surface.corners[:, 1].max() == pytest.approx(1.2)
    radius = np.linalg.norm(surface.corners[:, [0, 2]], axis=1)
    assert radius.max() == pytest.approx(0.05)
    assert volume(surface) == pytest.approx(np.pi * 0.05**2 * 0.2, rel=0.02)


def test_normals_point_out_of_a_surface() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [9, 9, 9]], dtype=float)
    surface = Surface(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    found = normals(surface)
    assert np.linalg.norm(found, axis=1) == pytest.approx(1.0)
    middle = corners[:4].mean(axis=0)
    assert ((corners[:4] - middle) * found[:4]).sum(axis=1).min() > 0.0


def test_bruce_is_drawn_as_high_as_it_is_and_touches_the_ground_with_toes_and_heels() -> None:
    """About 0.66 m with straight legs, by the paper; nothing of it hangs below the soles."""
    surfaces = robot_surfaces(BRUCE).links
    assert set(surfaces) == {link.name for link in BRUCE.links if link.mass > 0.02}
    base, turn = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(BRUCE, base, turn, np.zeros((1, len(BRUCE.joints))))
    heights = []
    for name, parts in surfaces.items():
        position, rotation = poses.of(name)
        heights.append((joined(parts).corners @ rotation[0].T + position[0])[:, 2])
    everything = np.concatenate(heights)
    assert np.ptp(everything) == pytest.approx(0.66, abs=0.02)
    sole = -(0.0384375 + 0.175 + 0.1695 + 0.024)
    assert everything.min() == pytest.approx(sole, abs=1e-3)


@needs_robots
@pytest.mark.parametrize("name", ["g1", "go2", "talos"])
def test_a_published_robot_takes_little_of_a_recording(name: str) -> None:
    robot = find_robot(name)
    found = robot_surfaces(robot)
    assert found.problems == [] and len(found.links) == len(robot.links)
    parts = [part for each in found.links.values() for part in each]
    assert sum(len(part.triangles) for part in parts) <= MOST_TRIANGLES
    assert sum(24 * len(s.corners) + 12 * len(s.triangles) for s in parts) < 600_000


WRONG = """looks:
  torso:
    boxes: [{size: [0.1, 0.1, 0.1], round: 0.06}, {size: [0.1, 0.1, 0.1], orientation: [0, 0, 0, 0]}]
    turned: [{profile: [[0.1, 0], [0.1, 1]], axis: [0, 0, 0]}, {profile: [[0, 0], [0, 1]]}]
"""


def test_parts_that_cannot_be_drawn_are_faults(tmp_path: Path) -> None:
    shipped = Path(__file__).parents[2] / "robots" / "bruce" / "bruce.yaml"
    text = shipped.read_text().partition("looks:")[0]
    (tmp_path / "b.yaml").write_text(text + WRONG)
    with pytest.raises(RobotError) as raised:
        read_description(tmp_path / "b.yaml")
    told = str(raised.value)
    for part in (
        "a box of link torso is rounded by more than half of its least side",
        "a box of link torso has no orientation",
        "a turned part of link torso has an axis without direction",
        "a turned part of link torso has no thickness",
    ):
        assert part in told
    (tmp_path / "b.yaml").write_text(
        text + "looks: {torso: {boxes: [{size: [0.1, -1, 0.1], color: red}]}}\n"
    )
    with pytest.raises(RobotError) as raised:
        read_description(tmp_path / "b.yaml")
    assert "size" in str(raised.value) and "color" in str(raised.value)
