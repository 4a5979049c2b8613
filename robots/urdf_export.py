"""A robot's description as a URDF, with which other programs have the same rigid bodies.

What a URDF cannot hold is left out: reflected rotor inertia, couplings between motors, the torque's
fall with speed. Its effort and speed limits are what the motors give a joint when nothing else
moves. Capsules become a cylinder with a ball at each end, and hulls meshes in files beside the URDF; contact points and sole centres become
links without mass, ``<name>`` and ``<foot>_sole``, whose origins they are.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ..mathematics.arrays import Array
from .importing.meshes import STL_TRIANGLE
from .robot_description import Joint, Link, RobotDescription
from .shapes import Capsule, Hull, surface

FREE = 1e3
"""The limits [m] of a slide that has none: a URDF demands some."""


def urdf_of(robot: RobotDescription, meshes: str = "meshes") -> str:
    """Return the URDF's text. All numbers are written with every digit they have.

    Args:
        robot: the robot.
        meshes: the folder, as the URDF names it, of the files of ``hull_meshes``.
    """
    root = Element("robot", name=robot.name)
    root.append(ElementTree.Comment(f" {robot.text or robot.name}, written by aloft "))
    _add_world(root, robot)
    for link in robot.links:
        _add_link(root, link, meshes)
    effort = np.abs(robot.joint_to_motor).T @ robot.motors.peak_torque
    speed = _fastest(robot)
    for k, joint in enumerate(robot.joints):
        damping, friction = float(robot.motors.damping[k]), float(robot.motors.friction[k])
        _add_joint(root, joint, float(effort[k]), float(speed[k]), damping, friction)
    feet = {foot.name: foot for foot in robot.feet}
    for contact in robot.contacts:
        _add_frame(root, contact.name, feet[contact.foot].link, contact.position)
    for foot in robot.feet:
        _add_frame(root, f"{foot.name}_sole", foot.link, foot.sole)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def _fastest(robot: RobotDescription) -> Array:
    """Return the largest speed of each joint alone [rad/s, m/s], which its first motor limits."""
    gears = np.abs(robot.joint_to_motor)
    allowed = robot.motors.no_load_speed[:, None] / np.where(gears > 0.0, gears, np.nan)
    return np.asarray(np.nanmin(allowed, axis=0)) if len(robot.joints) else np.zeros(0)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _add_world(root: Element, robot: RobotDescription) -> None:
    """Add what holds a base that does not float: a world, and joints as the base has motions."""
    if robot.base_joint == "floating":
        return
    SubElement(root, "link", name="world")
    if robot.base_joint == "fixed":
        _connect(root, "world_joint", "fixed", "world", robot.base)
        return
    steps = (("base_x", "prismatic", "1 0 0"), ("base_z", "prismatic", "0 0 1"),
             ("base_pitch", "continuous", "0 1 0"))  # fmt: skip
    parent = "world"
    for k, (name, kind, axis) in enumerate(steps):
        child = robot.base if k == 2 else f"{name}_link"
        if child != robot.base:
            SubElement(root, "link", name=child)
        joint = _connect(root, name, kind, parent, child)
        SubElement(joint, "axis", xyz=axis)
        if kind == "prismatic":
            far = repr(FREE)
            SubElement(joint, "limit", lower=f"-{far}", upper=far, effort="0", velocity="0")
        parent = child


def _connect(root: Element, name: str, kind: str, parent: str, child: str) -> Element:
    joint = SubElement(root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def hull_meshes(robot: RobotDescription) -> dict[str, bytes]:
    """Return the convex hulls as binary STL, by the name of the file: a URDF has no shape for them."""
    found = {}
    for link in robot.links:
        for k, shape in enumerate(link.shapes):
            if isinstance(shape, Hull):
                places, triangles = surface(shape)
                content = np.zeros(len(triangles), STL_TRIANGLE)
                content["corners"] = places[triangles]
                count = np.array([len(triangles)], "<u4").tobytes()
                found[_mesh_name(link, k)] = bytes(80) + count + content.tobytes()
    return found


def _mesh_name(link: Link, number: int) -> str:
    return f"{link.name.replace('/', '_')}_{number}.stl"


def _add_link(root: Element, link: Link, meshes: str) -> None:
    element = SubElement(root, "link", name=link.name)
    if link.mass > 0.0:
        inertial = SubElement(element, "inertial")
        SubElement(inertial, "origin", xyz=_numbers(link.com), rpy="0 0 0")
        SubElement(inertial, "mass", value=repr(link.mass))
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        inertia = SubElement(inertial, "inertia")
        for name, value in zip(names, link.inertia, strict=True):
            inertia.set(name, repr(value))
    for k, shape in enumerate(link.shapes):
        for kind in ("visual", "collision"):
            if isinstance(shape, Capsule):
                _add_capsule(element, kind, shape)
            else:
                geometry = SubElement(SubElement(element, kind), "geometry")
                SubElement(geometry, "mesh", filename=f"{meshes}/{_mesh_name(link, k)}")


def _add_capsule(element: Element, kind: str, shape: Capsule) -> None:
    start, end = np.array(shape.start), np.array(shape.end)
    along, radius = end - start, repr(shape.radius)
    length = float(np.linalg.norm(along))
    roll = -np.arcsin(np.clip(along[1] / length, -1.0, 1.0)) if length > 0.0 else 0.0
    pitch = np.arctan2(along[0], along[2]) if length > 0.0 else 0.0
    # z is turned by the roll first and then by the pitch, so that it points along the capsule.
    rod = SubElement(element, kind)
    SubElement(rod, "origin", xyz=_numbers(0.5 * (start + end)), rpy=_numbers((roll, pitch, 0.0)))
    cylinder = SubElement(SubElement(rod, "geometry"), "cylinder")
    cylinder.attrib.update(radius=radius, length=repr(length))
    for place in (start, end):
        ball = SubElement(element, kind)
        SubElement(ball, "origin", xyz=_numbers(place), rpy="0 0 0")
        SubElement(SubElement(ball, "geometry"), "sphere", radius=radius)


def _add_joint(
    root: Element, joint: Joint, effort: float, speed: float, damping: float, friction: float
) -> None:
    kind = "prismatic" if joint.kind == "slide" else "revolute" if joint.limits else "continuous"
    element = _connect(root, joint.name, kind, joint.parent, joint.child)
    SubElement(element, "origin", xyz=_numbers(joint.origin), rpy="0 0 0")
    SubElement(element, "axis", xyz=_numbers(joint.axis))
    limit = SubElement(element, "limit", effort=repr(effort), velocity=repr(speed))
    if joint.limits or kind == "prismatic":
        lower, upper = joint.limits or (-FREE, FREE)
        limit.attrib.update(lower=repr(lower), upper=repr(upper))
    SubElement(element, "dynamics", damping=repr(damping), friction=repr(friction))


def _add_frame(root: Element, name: str, link: str, place: Iterable[float]) -> None:
    SubElement(root, "link", name=name)
    joint = _connect(root, f"{name}_fixed", "fixed", link, name)
    SubElement(joint, "origin", xyz=_numbers(place), rpy="0 0 0")
