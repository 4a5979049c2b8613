"""Meshes of URDF and MJCF files come into a description, and their triangles out of the files."""

from pathlib import Path

import numpy as np
import pytest

from aloft.robots.description import RobotError, find_robot, read_description
from aloft.robots.importing import meshes
from aloft.robots.importing.meshes import mesh_triangles, simplified
from aloft.robots.importing.package_files import find_file

from ..example_robots import needs_robots
from .model_files import INERTIAL

URDF = f"""<robot name="arm">
  <link name="base">{INERTIAL}</link>
  <link name="upper">{INERTIAL}
    <visual><origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>
      <geometry><mesh filename="upper.obj" scale="2 2 2"/></geometry></visual>
    <visual><geometry><sphere radius="0.05"/></geometry></visual>
    <collision><geometry><sphere radius="0.06"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="20" velocity="5"/>
  </joint>
  <link name="hand">
    <visual><geometry><mesh filename="package://nowhere/hand.stl"/></geometry></visual></link>
  <joint name="wrist" type="fixed">
    <parent link="upper"/><child link="hand"/><origin xyz="0 0 0.3"/></joint>
</robot>
"""
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nf 1/1 2/2 3/3 4/4\nf -1 1 2\n"
MJCF = """<mujoco model="stick"><asset>
    <mesh name="look" file="look.obj" scale="0.1 0.1 0.1"/><mesh name="hull" file="hull.obj"/></asset>
  <worldbody><body name="torso" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <geom type="mesh" mesh="look" contype="0" conaffinity="0" pos="0 0 0.2"/>
    <geom type="mesh" mesh="hull"/></body></worldbody></mujoco>
"""


def test_the_meshes_of_a_urdf(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF)
    (tmp_path / "upper.obj").write_text(OBJ)
    robot = read_description(tmp_path / "arm.urdf")
    assert list(robot.looks) == ["upper"]
    upper, hand = robot.looks["upper"].meshes  # a link that is fixed to another is part of it
    assert upper.file == str((tmp_path / "upper.obj").resolve())
    assert upper.position == (0.0, 0.0, 0.1) and upper.scale == (2.0, 2.0, 2.0)
    assert upper.orientation == pytest.approx((0, 0, 0.5**0.5, 0.5**0.5), abs=1e-8)
    assert hand.file == "package://nowhere/hand.stl" and hand.position == (0.0, 0.0, 0.3)
    (ball,) = robot.looks["upper"].shapes
    assert ball.radius == pytest.approx(0.05)
    # its content, on which plans and replays depend, is what it was without meshes
    assert "looks" not in robot.model_dump() and "looks" not in robot.model_dump_json()
    there = robot.model_dump(context={"looks": True})["looks"]
    assert type(robot).model_validate(robot.model_dump() | {"looks": there}) == robot


def test_an_mjcf_body_looks_like_what_touches_nothing(tmp_path: Path) -> None:
    (tmp_path / "stick.xml").write_text(MJCF)
    for name in ("look.obj", "hull.obj"):
        (tmp_path / name).write_text(OBJ)
    (mesh,) = read_description(tmp_path / "stick.xml").looks["torso"].meshes
    assert mesh.file == str((tmp_path / "look.obj").resolve())
    assert mesh.position == (0.0, 0.0, 0.2) and mesh.scale == (0.1, 0.1, 0.1)


def test_meshes_have_the_colors_of_the_file(tmp_path: Path) -> None:
    for name in ("upper.obj", "look.obj", "hull.obj"):
        (tmp_path / name).write_text(OBJ)
    colored = URDF.replace(
        'scale="2 2 2"/></geometry>', 'scale="2 2 2"/></geometry><material name="sea"/>'
    ).replace(
        'hand.stl"/></geometry>',
        'hand.stl"/></geometry><material name=""><color rgba="0 0.5 2 1"/></material>',
    )
    named = '<material name="sea"><color rgba="0.2 0.4 0.6 1"/></material></robot>'
    path = tmp_path / "arm.urdf"

    def colors(text: str) -> list[str | None]:
        path.write_text(text)
        return [mesh.color for mesh in read_description(path).looks["upper"].meshes]

    assert colors(URDF) == [None, None]
    assert colors(colored) == [None, "#0080ff"]  # no material of that name has a color
    assert colors(colored.replace("</robot>", named)) == ["#336699", "#0080ff"]
    textured = named.replace("</material>", '<texture filename="sea.png"/></material>')
    assert colors(colored.replace("</robot>", textured)) == [None, "#0080ff"]

    def color(attributes: str) -> str | None:
        material = '<asset><material name="sea" rgba="0.2 0.4 0.6 1"/>'
        text = MJCF.replace("<asset>", material).replace('mesh="look"', f'mesh="look" {attributes}')
        (tmp_path / "stick.xml").write_text(text)
        (mesh,) = read_description(tmp_path / "stick.xml").looks["torso"].meshes
        return mesh.color

    assert color("") is None
    assert color('material="sea"') == "#336699"
    assert color('material="sea" rgba="1 0 0 1"') == "#ff0000"


def test_a_user_gives_links_meshes(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(URDF)
    (tmp_path / "arm.yaml").write_text("looks: {base: {meshes: [{file: parts/b.stl}]}}\n")
    looks = read_description(tmp_path / "arm.urdf").looks
    assert list(looks) == ["base"]
    assert looks["base"].meshes[0].file == str(tmp_path / "parts" / "b.stl")
    (tmp_path / "arm.yaml").write_text(
        "looks: {bas: {meshes: [{file: b.stl, orientation: [0, 0, 0, 0]}]}}\n"
    )
    with pytest.raises(
        RobotError, match="the link of a look is 'bas', and there is no such link"
    ) as raised:
        read_description(tmp_path / "arm.urdf")
    assert "has no orientation" in str(raised.value)


def test_faces_become_triangles(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    triangles = mesh_triangles(tmp_path / "a.obj")
    assert triangles.tolist() == [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 0, 1], [0, 0, 0], [1, 0, 0]],
    ]  # fmt: skip


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array>
    <technique_common><accessor stride="3"/></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/>
    <input semantic="NORMAL" source="#n" offset="1"/><vcount>4</vcount><p>0 9 1 9 2 9 3 9</p></polylist>
  <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene>
  <node><translate>0 0 5</translate><rotate>0 0 1 90</rotate>
    <node><scale>2 2 2</scale><instance_geometry url="#g"/></node></node>
</visual_scene></library_visual_scenes></COLLADA>
"""


def test_a_collada_file_with_nodes_in_nodes(tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text(COLLADA)
    triangles = mesh_triangles(tmp_path / "a.dae")
    assert triangles.shape == (3, 3, 3)
    # twice as large, turned by 90 degrees about z, 5 units up, in centimetres
    expected = 0.01 * np.array([[0, 0, 5], [0, 2, 5], [-2, 2, 5]])
    assert np.allclose(triangles[:2], expected)
    assert np.allclose(triangles[2], 0.01 * np.array([[0, 0, 5], [-2, 2, 5], [-2, 0, 5]]))


def test_corners_of_a_collada_file_may_have_further_numbers(tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text(COLLADA)
    wide = COLLADA.replace("0 0 0 1 0 0 1 1 0 0 1 0", "0 0 0 7 1 0 0 8 1 1 0 9 0 1 0 7")
    (tmp_path / "b.dae").write_text(wide.replace('stride="3"', 'stride="4"'))
    bare = '<technique_common><accessor stride="3"/></technique_common>'
    (tmp_path / "c.dae").write_text(COLLADA.replace(bare, ""))
    expected = mesh_triangles(tmp_path / "a.dae")
    for name in ("b.dae", "c.dae"):
        np.testing.assert_array_equal(mesh_triangles(tmp_path / name), expected)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.dae", "<COLLADA", "no XML"),
        ("a.dae", "<robot/>", "no COLLADA file"),
        ("a.dae", COLLADA.replace('url="#g"', 'url="#h"'), "'h'"),
        ("a.dae", COLLADA.replace("<vcount>4", "<vcount>9"), "more corners than there are"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "out of bounds"),
        ("a.stl", "nothing", "0 triangles"),
        ("a.step", "", r"no mesh of the formats \.stl, \.obj, \.dae"),
    ],
)
def test_what_is_no_mesh_is_said_with_its_file(
    name: str, content: str, told: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(ValueError, match=rf"a\.\w+: .*{told}"):
        mesh_triangles(tmp_path / name)


def ball(size: int) -> np.ndarray:
    """The triangles of a ball of radius 1."""
    turns = np.linspace(0.0, 2.0 * np.pi, 2 * size + 1)
    tilts = np.linspace(0.0, np.pi, size + 1)
    turn, tilt = np.meshgrid(turns, tilts)
    points = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -2), np.stack([a, c, d], -2)]).reshape(-1, 3, 3)


def test_a_simplified_surface_is_nearly_the_same() -> None:
    triangles = ball(60)
    corners, faces = simplified(triangles, 2000)
    assert 800 < len(faces) <= 2000 and faces.max() == len(corners) - 1
    assert np.linalg.norm(corners, axis=1).min() > 0.95
    area = 0.5 * np.linalg.norm(
        np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]]),
        axis=1,
    ).sum()  # fmt: skip
    assert area == pytest.approx(4.0 * np.pi, rel=0.05)
    # what is small enough keeps its triangles, with each corner once
    corners, faces = simplified(triangles[:50], 2000)
    kept = sorted(map(sorted, corners[faces].round(3).tolist()))
    sides = np.linalg.norm(triangles[:50] - np.roll(triangles[:50], 1, axis=1), axis=2).min(axis=1)
    assert kept == sorted(map(sorted, triangles[:50][sides > 1e-9].round(3).tolist()))


@needs_robots
@pytest.mark.parametrize("name", ["go2", "g1", "solo12", "talos"])
def test_published_robots_have_a_mesh_on_every_link(name: str) -> None:
    robot = find_robot(name)
    assert set(robot.looks) == {link.name for link in robot.links}
    for look in robot.looks.values():
        for mesh in look.meshes:
            assert mesh.file.startswith("package://")
            assert find_file(mesh.file, Path()) is not None


@pytest.mark.parametrize("corner", ["nan 0 0", "0 inf 0"])
def test_a_mesh_with_a_corner_that_is_nowhere_is_refused(tmp_path: Path, corner: str) -> None:
    file = tmp_path / "part.obj"
    faces = "f 1 2 3\nf 2 3 4\n"
    file.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 2\n{faces}")
    triangles = mesh_triangles(file)
    assert triangles.tolist() == [
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [0, 1, 0], [0, 0, 2]],
    ]  # fmt: skip
    file.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv {corner}\n{faces}")
    with pytest.raises(ValueError, match="a mesh of 2 triangles, or not all are finite"):
        mesh_triangles(file)
    file.write_text("v 0 0 0\n")
    with pytest.raises(ValueError, match="a mesh of 0 triangles"):
        mesh_triangles(file)


def test_a_mesh_of_few_lines_that_asks_for_a_billion_triangles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each node has the next one ten times: 10^9 triangles in ten nodes."""
    monkeypatch.setattr(meshes, "MOST_NODES", meshes.MOST_NODES // 10)
    inner = "".join('<instance_node url="#n{k}"/>' for _ in range(10))
    nodes = (
        "".join(f'<node id="n{k}">{inner.format(k=k + 1)}</node>' for k in range(9))
        + '<node id="n9"><instance_geometry url="#g"/></node>'
    )
    text = (
        COLLADA[: COLLADA.index("<library_visual_scenes")]
        if "<library_visual_scenes" in COLLADA
        else COLLADA
    )
    scene = f'<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>'
    (tmp_path / "a.dae").write_text(text + scene + "</COLLADA>")
    with pytest.raises(ValueError, match=r"nodes in one another|triangles; expected"):
        mesh_triangles(tmp_path / "a.dae")


def test_a_mesh_that_is_no_file_or_too_large_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no file, or one of more than 256 MiB"):
        mesh_triangles(Path("/dev/zero").with_name("zero.stl"))
    with (tmp_path / "sparse.stl").open("wb") as file:
        file.truncate(84 + 50 * 10**9)
    with pytest.raises(ValueError, match="256 MiB"):
        mesh_triangles(tmp_path / "sparse.stl")
