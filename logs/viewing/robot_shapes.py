"""The links of a robot as Rerun draws them: meshes, solid capsules, or outlines of a second robot.

Meshes are simplified until they are small enough to be kept in every recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.rotations import matrices_of_quaternions
from ...robots.description import Appearance, Link, Mesh, RobotDescription, Shape
from ...robots.importing.meshes import mesh_triangles, simplified
from ...robots.importing.urdf_text import find_file
from ...robots.kinematics import link_poses

USUAL_REACH = 0.4
"""The reach [m] of the robot that the sizes of marks and lines are given for."""


def shapes_of(robot: RobotDescription, link: Link) -> list[Shape]:
    """What is drawn for a link: its collision shapes, or else bones from its origin.

    The bones go to the joints that the link carries and to its contact points.
    """
    if link.shapes:
        return list(link.shapes)
    feet = [foot.name for foot in robot.feet if foot.link == link.name]
    ends = [joint.origin for joint in robot.joints if joint.parent == link.name]
    ends += [contact.position for contact in robot.contacts if contact.foot in feet]
    radius = 0.025 * reach_of(robot)
    return [Shape(start=(0.0, 0.0, 0.0), end=end, radius=radius) for end in ends]


def reach_of(robot: RobotDescription) -> float:
    """The largest distance of a link's origin from the base's in the standing pose [m].

    It is the measure of how large things are drawn; 0.1 m for a robot of one link.
    """
    base, turn = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(robot, base, turn, robot.standing_position[None])
    return max(0.1, float(np.linalg.norm(poses.position[0], axis=1).max()))


def scale_of(robot: RobotDescription) -> float:
    """How large marks, lines and arrows are drawn, as a factor of what suits BRUCE."""
    return reach_of(robot) / USUAL_REACH


def eye_controls(
    robot: RobotDescription | None, distance: float = 1.0, follow: str | None = None
) -> Any:
    """An eye to the right and in front of a standing robot, ``distance`` times the usual way off.

    With ``follow`` it keeps its place beside that entity, which moves along with the robot.
    """
    import rerun.blueprint as rrb

    size = 3.2 * (reach_of(robot) if robot is not None else USUAL_REACH)
    position = tuple(distance * size * part for part in (0.6, -0.8, 0.4))
    height = eye_height(robot) if robot is not None else 0.25 * size
    return rrb.EyeControls3D(
        position=position, look_target=(0.0, 0.0, height), tracking_entity=follow
    )


def eye_height(robot: RobotDescription) -> float:
    """The height [m] at which the camera looks: that of the base in the standing pose."""
    return 0.85 * reach_of(robot)


def capsules(
    shapes: Sequence[Shape], color: int, *, wires: bool = False, line_radius: float = 0.0006
) -> Any:
    """Rerun's capsules for ``shapes``, in the link's frame; with ``wires`` only their outlines.

    A capsule of Rerun's reaches from its origin along +z, so each is turned.
    """
    import rerun as rr

    starts = np.array([shape.start for shape in shapes]).reshape(-1, 3)
    spans = np.array([shape.end for shape in shapes]).reshape(-1, 3) - starts
    lengths = np.linalg.norm(spans, axis=1)
    return rr.Capsules3D(
        lengths=lengths,
        radii=[shape.radius for shape in shapes],
        translations=starts,
        quaternions=np.array([quaternion_from_z(span) for span in spans]).reshape(-1, 4),
        # an array of 32-bit colours: a list of four numbers could be one colour's red, green, blue
        # and alpha
        colors=np.full(len(shapes), color, np.uint32),
        line_radii=np.full(len(shapes), line_radius),
        fill_mode="majorwireframe" if wires else "solid",
    )


def quaternion_from_z(direction: Array) -> Array:
    """The shortest rotation x, y, z, w from +z to ``direction``, which need not be a unit vector."""
    length = float(np.linalg.norm(direction))
    if length < 1e-12:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = direction / length
    if z < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])  # straight down: any half turn will do
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / float(np.linalg.norm(quaternion))


MOST_TRIANGLES = 24_000
"""Of a whole robot. Such a robot takes half a megabyte in a recording."""
BESIDE = "beside"
"""The entity below a link of the simple shapes that are drawn beside its meshes."""


@dataclass(frozen=True)
class Surface:
    """Corners (n, 3) [m, link frame] and the triangles (m, 3) between them."""

    corners: Array
    triangles: NDArray[np.int64]


@dataclass
class RobotMeshes:
    """The surface of each link whose meshes could all be read, and a sentence for each that could
    not: such a link is drawn as its collision shapes."""

    surfaces: dict[str, Surface] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


def missing_meshes(robot: RobotDescription) -> list[str]:
    """A sentence for each link of which a mesh is not there; no mesh is read."""
    return [
        _absent(link, mesh)
        for link, look in robot.looks.items()
        for mesh in look.meshes
        if _path(mesh) is None
    ]


def read_meshes(robot: RobotDescription) -> RobotMeshes:
    """Read all meshes of a robot, each made coarser where that is needed to have at most
    ``MOST_TRIANGLES`` in all. Files that serve several links are read once."""
    result = RobotMeshes()
    count = sum(len(look.meshes) for look in robot.looks.values())
    most = MOST_TRIANGLES // max(1, count)
    known: dict[Path, Surface] = {}
    for link, look in robot.looks.items():
        try:
            result.surfaces[link] = _joined(link, look, most, known)
        except (OSError, ValueError) as error:
            result.problems.append(str(error))
    return result


def _joined(link: str, look: Appearance, most: int, known: dict[Path, Surface]) -> Surface:
    """All meshes of a link as one. Raises ``OSError`` or ``ValueError`` with the sentence to tell."""
    corners: list[Array] = []
    triangles: list[NDArray[np.int64]] = []
    start = 0
    for mesh in look.meshes:
        path = _path(mesh)
        if path is None:
            raise ValueError(_absent(link, mesh))
        if path not in known:
            try:
                known[path] = Surface(*simplified(mesh_triangles(path), most))
            except (OSError, ValueError) as error:
                raise ValueError(
                    f"link {link} is drawn as its collision shapes: the mesh cannot be read ({error})"
                ) from error
        placed = known[path].corners * np.array(mesh.scale) @ _rotation(mesh).T
        corners.append(placed + np.array(mesh.position))
        triangles.append(known[path].triangles + start)
        start += len(placed)
    return Surface(np.concatenate(corners), np.concatenate(triangles))


def _path(mesh: Mesh) -> Path | None:
    return find_file(mesh.file, Path())


def _absent(link: str, mesh: Mesh) -> str:
    return f"link {link} is drawn as its collision shapes: there is no mesh {mesh.file}"


def _rotation(mesh: Mesh) -> Array:
    return matrices_of_quaternions(np.array(mesh.orientation))


def drawn_link(
    robot: RobotDescription,
    link: Link,
    meshes: RobotMeshes,
    color: int,
    line_radius: float = 0.0006,
) -> dict[str, Any]:
    """What Rerun draws for a link in one colour (0xRRGGBBAA), by what follows the link's entity: its
    meshes and what belongs to them, or its shapes, or nothing."""
    import rerun as rr

    surface = meshes.surfaces.get(link.name)
    if surface is None:
        shapes = shapes_of(robot, link)
        return {"": capsules(shapes, color, line_radius=line_radius)} if shapes else {}
    drawn: dict[str, Any] = {
        "": rr.Mesh3D(
            vertex_positions=surface.corners.astype(np.float32),
            # without normals the viewer shows a mesh as if it gave light itself: a mere outline
            vertex_normals=normals(surface).astype(np.float32),
            triangle_indices=surface.triangles.astype(np.uint32),
            albedo_factor=color,
        )
    }
    if beside := robot.looks[link.name].shapes:
        drawn[f"/{BESIDE}"] = capsules(beside, color, line_radius=line_radius)
    return drawn


def normals(surface: Surface) -> Array:
    """The unit normal at each corner, (n, 3): the mean of those of its triangles by their areas."""
    a, b, c = (surface.corners[surface.triangles[:, k]] for k in range(3))
    each = np.cross(b - a, c - a)
    found = np.zeros_like(surface.corners)
    for k in range(3):
        np.add.at(found, surface.triangles[:, k], each)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    result: Array = np.where(length > 0.0, found / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    return result
