"""The links of a robot as Rerun draws them: surfaces, solid shapes, or outlines of a second robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.kinematics import link_poses
from ...robots.robot_description import Link, RobotDescription
from ...robots.shapes import Capsule, Hull, Shape, edges, surface
from ...robots.surfaces import RobotSurfaces, Surface, joined, normals, quaternion_from_z

USUAL_REACH = 0.4
"""The reach [m] of the robot that the sizes of marks and lines are given for."""


def shapes_of(robot: RobotDescription, link: Link) -> list[Shape]:
    """Return the shapes drawn for a link: its collision shapes, or else bones from its origin.

    The bones go to the joints that the link carries and to its contact points.
    """
    if link.shapes:
        return list(link.shapes)
    feet = [foot.name for foot in robot.feet if foot.link == link.name]
    ends = [joint.origin for joint in robot.joints if joint.parent == link.name]
    ends += [contact.position for contact in robot.contacts if contact.foot in feet]
    radius = 0.025 * reach_of(robot)
    return [Capsule(start=(0.0, 0.0, 0.0), end=end, radius=radius) for end in ends]


def reach_of(robot: RobotDescription) -> float:
    """Return the largest distance of a link's origin from the base's in the standing pose [m].

    It is the measure of how large things are drawn; 0.1 m for a robot of one link.
    """
    base, turn = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = link_poses(robot, base, turn, robot.standing_position[None])
    return max(0.1, float(np.linalg.norm(poses.position[0], axis=1).max()))


def scale_of(robot: RobotDescription) -> float:
    """Return the scale of marks, lines and arrows, as a factor on that of BRUCE."""
    return reach_of(robot) / USUAL_REACH


def eye_controls(
    robot: RobotDescription | None, distance: float = 1.0, follow: str | None = None
) -> Any:
    """Place an eye in front and to the right of a standing robot, ``distance`` times the usual way
    off.

    With ``follow`` it keeps its place beside that entity, which moves along with the robot.
    """
    import rerun.blueprint as rrb

    size = 2.4 * (reach_of(robot) if robot is not None else USUAL_REACH)
    position = tuple(distance * size * part for part in (0.8, -0.6, 0.35))
    height = eye_height(robot) if robot is not None else 0.25 * size
    return rrb.EyeControls3D(
        position=position, look_target=(0.0, 0.0, height), tracking_entity=follow
    )


def eye_height(robot: RobotDescription) -> float:
    """Return the height [m] at which the camera looks: that of the base in the standing pose."""
    return 0.85 * reach_of(robot)


HULLS = "hulls"
"""The entity below a link of its convex hulls."""


def drawn_shapes(
    shapes: Sequence[Shape], color: int, *, wires: bool = False, line_radius: float = 0.0006
) -> dict[str, Any]:
    """Make Rerun's drawing of ``shapes``, in the link's frame, by the part of the entity's path
    after the link's; with ``wires`` only their outlines."""
    drawn = dict[str, Any]()
    if capsules := [shape for shape in shapes if isinstance(shape, Capsule)]:
        drawn[""] = _capsules(capsules, color, wires, line_radius)
    if hulls := [shape for shape in shapes if isinstance(shape, Hull)]:
        drawn[f"/{HULLS}"] = _hulls(hulls, color, wires, line_radius)
    return drawn


def _hulls(hulls: Sequence[Hull], color: int, wires: bool, line_radius: float) -> Any:
    import rerun as rr

    if wires:
        strips = [np.array(edge, np.float32) for hull in hulls for edge in edges(hull)]
        return rr.LineStrips3D(
            strips,
            colors=np.full(len(strips), color, np.uint32),
            radii=np.full(len(strips), line_radius),
        )
    return _mesh(joined([Surface(*surface(hull)) for hull in hulls]), color)


def _mesh(
    whole: Surface, color: int | None, vertex_colors: NDArray[np.uint32] | None = None
) -> Any:
    import rerun as rr

    return rr.Mesh3D(
        vertex_positions=whole.corners.astype(np.float32),
        # without normals the viewer shows a mesh as if it gave light itself: a mere outline
        vertex_normals=normals(whole).astype(np.float32),
        triangle_indices=whole.triangles.astype(np.uint32),
        vertex_colors=vertex_colors,
        albedo_factor=color,
    )


def _capsules(shapes: Sequence[Capsule], color: int, wires: bool, line_radius: float) -> Any:
    """Make Rerun's capsules, which reach from their origin along +z, so each is turned."""
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


BESIDE = "beside"
"""The entity below a link of the simple shapes that are drawn beside its surfaces."""


def drawn_link(
    robot: RobotDescription,
    link: Link,
    surfaces: RobotSurfaces,
    color: int,
    line_radius: float = 0.0006,
    *,
    own_colors: bool = True,
) -> dict[str, Any]:
    """Make Rerun's drawing of a link, by the part of the entity's path after the link's: its
    surfaces and what belongs to them, or its collision shapes, or nothing.

    ``color`` (0xRRGGBBAA) is that of all whose colour the description does not say; without ``own_colors`` of all.
    """

    parts = surfaces.links.get(link.name)
    if parts is None:
        return drawn_shapes(shapes_of(robot, link), color, line_radius=line_radius)
    whole = joined(parts)
    painted = own_colors and any(part.color is not None for part in parts)
    each = [color if part.color is None else part.color << 8 | 0xFF for part in parts]
    painting = np.repeat(np.array(each, np.uint32), [len(part.corners) for part in parts])
    drawn = {"": _mesh(whole, None, painting) if painted else _mesh(whole, color)}
    beside = drawn_shapes(robot.looks[link.name].shapes, color, line_radius=line_radius)
    return drawn | {f"/{BESIDE}{below}": each for below, each in beside.items()}
