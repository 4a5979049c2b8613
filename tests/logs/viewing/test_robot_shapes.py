"""How robots of any kind are drawn."""

import re
import warnings
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from aloft import load
from aloft.logs import read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.contacts import force_scale
from aloft.logs.viewing.robot_shapes import drawn_link, drawn_shapes, reach_of, shapes_of
from aloft.robots.description import Appearance, Capsule, Hull, Mesh, RobotDescription, find_robot
from aloft.robots.surfaces import joined, missing_meshes, robot_surfaces

from ...robots.example_robots import needs_robots

BRUCE = find_robot("bruce")


@pytest.mark.parametrize("count", [0, 1, 3, 4, 5])
def test_links_of_any_number_of_shapes_are_drawn_without_a_warning(count: int) -> None:
    shapes = [
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.1 * k, 0.1), radius=0.01) for k in range(count)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawn = drawn_shapes(shapes, 0x90A4AEFF)
    assert list(drawn) == ([""] if count else [])
    assert not count or len(drawn[""].colors.as_arrow_array()) == count


CUBE = Hull(corners=tuple(product((-0.1, 0.1), repeat=3)))


def test_a_hull_is_drawn_as_its_faces_or_its_edges() -> None:
    import rerun as rr

    ball = Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.0004), radius=0.05)
    drawn = drawn_shapes([ball, CUBE, CUBE], 0x90A4AEFF)
    assert list(drawn) == ["", "/hulls"]
    assert isinstance(drawn["/hulls"], rr.Mesh3D)
    assert len(drawn["/hulls"].triangle_indices.as_arrow_array()) == 2 * 12
    wires = drawn_shapes([CUBE], 0x90A4AEFF, wires=True)["/hulls"]
    assert len(wires.strips.as_arrow_array()) == 12 + 6  # a line across each face


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


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def with_look(folder: Path, *files: str) -> RobotDescription:
    """BRUCE whose base is drawn as these files, with one ball beside them."""
    meshes = tuple(
        Mesh(file=str(folder / name), position=(0.0, 0.0, 0.5), scale=(0.1, 0.1, 0.2))
        for name in files
    )
    ball = Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.0004), radius=0.05)
    return BRUCE.changed(looks={BRUCE.base: Appearance(meshes=meshes, shapes=(ball,))})


def test_a_link_is_drawn_as_its_meshes(tmp_path: Path) -> None:
    import rerun as rr

    (tmp_path / "a.obj").write_text(TETRAHEDRON)
    robot = with_look(tmp_path, "a.obj", "a.obj")
    surfaces = robot_surfaces(robot)
    assert surfaces.problems == [] and list(surfaces.links) == [robot.base]
    surface = joined(surfaces.links[robot.base])
    assert surface.corners.shape == (8, 3) and surface.triangles.shape == (8, 3)
    assert np.ptp(surface.corners, axis=0) == pytest.approx([0.1, 0.1, 0.2])
    assert surface.corners[:, 2].min() == pytest.approx(0.5)
    drawn = drawn_link(robot, robot.link(robot.base), surfaces, 0x90A4AEFF)
    assert [type(each) for each in drawn.values()] == [rr.Mesh3D, rr.Capsules3D]
    assert list(drawn) == ["", "/beside"]
    other = next(link for link in robot.links if link.name != robot.base)
    assert isinstance(drawn_link(robot, other, surfaces, 0x90A4AEFF)[""], rr.Capsules3D)


def test_a_painted_link_keeps_its_colours_unless_another_run_is_shown_beside_it() -> None:
    surfaces, torso = robot_surfaces(BRUCE), BRUCE.link("torso")
    parts = surfaces.links["torso"]
    own = drawn_link(BRUCE, torso, surfaces, 0x90A4AEFF)[""]
    found = own.vertex_colors.as_arrow_array().to_pylist()
    assert found[0] == parts[0].color << 8 | 0xFF and len(set(found)) > 3
    assert len(found) == sum(len(part.corners) for part in parts)
    other = drawn_link(BRUCE, torso, surfaces, 0xD7A86EFF, own_colors=False)[""]
    assert other.vertex_colors is None
    assert other.albedo_factor.as_arrow_array().to_pylist() == [0xD7A86EFF]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, r"link base is drawn as its collision shapes: there is no mesh .*a\.obj"),
        ("v 1 2", r"link base is drawn as its .*: the mesh cannot be read \(.*a\.obj"),
    ],
)
def test_what_is_missing_is_a_warning_and_the_shapes_are_drawn(
    content: str | None, told: str, tmp_path: Path
) -> None:
    import rerun as rr

    if content is not None:
        (tmp_path / "a.obj").write_text(content)
    robot = with_look(tmp_path, "a.obj")
    surfaces = robot_surfaces(robot)
    assert surfaces.links == {}
    (problem,) = surfaces.problems
    assert re.match(told.replace("base", robot.base), problem)
    assert missing_meshes(robot) == ([problem] if content is None else [])
    drawn = drawn_link(robot, robot.link(robot.base), surfaces, 0x90A4AEFF)
    assert [type(each) for each in drawn.values()] == [rr.Capsules3D]


@pytest.mark.long
@needs_robots
def test_a_recording_names_the_meshes_that_were_not_there(tmp_path: Path) -> None:
    """The run goes on, says so at its end, and its recording has the robot as capsules."""
    root = Path(__file__).parents[3]
    shipped = (root / "robots" / "solo12" / "solo12.yaml").read_text()
    looks = "looks: {base_link: {meshes: [{file: gone/base.stl}]}}\n"
    (tmp_path / "solo.yaml").write_text(shipped + looks)
    graphs = root / "graphs"
    (tmp_path / "stand.yaml").write_text(
        f"robot: solo.yaml\ninclude: [{graphs}/robots/stand.yaml]\n"
    )
    graph = load(tmp_path / "stand.yaml", ["duration=0.02 s"])
    recorder = Recorder(tmp_path / "solo.rrd")
    graph.run(sinks=[recorder], log=False)
    (warning,) = [text for text in recorder.warnings if "mesh" in text]
    assert warning.endswith(f"there is no mesh {tmp_path / 'gone' / 'base.stl'}")
    header = read(tmp_path / "solo.rrd").header
    assert header.robot is not None and list(header.robot.looks) == ["base_link"]


def test_many_missing_meshes_are_one_sentence() -> None:
    lost = Appearance(meshes=(Mesh(file="a.obj"), Mesh(file="b.obj")))
    first, second, *others = (link.name for link in BRUCE.links)
    one = BRUCE.changed(looks={first: lost})
    assert missing_meshes(one) == [
        f"link {first} is drawn as collision shapes: 2 meshes are missing, the first is a.obj"
    ]
    every = BRUCE.changed(looks={link.name: lost for link in BRUCE.links})
    count = len(BRUCE.links)
    assert missing_meshes(every) == [
        (
            f"{count} links ({first}, {second}, {others[0]} and {count - 3} more) are drawn as collision shapes: "
            f"{2 * count} meshes are missing, the first is a.obj"
        )
    ]
