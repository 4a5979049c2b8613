"""Appearance of the links of a URDF or MJCF file: the meshes that it draws them as."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.rotations import from_euler, matrices_of_quaternions, quaternions_of_matrices
from . import capsules as fit
from .package_files import located
from .urdf_text import XmlFile


@dataclass(frozen=True)
class RawMesh:
    """A mesh as the file names it, in its body's frame; ``scale`` (3,) comes before the pose.

    ``color`` is ``#RRGGBB``; None where the file gives the mesh none.
    """

    file: str
    rotation: Array
    position: Array
    scale: Array
    color: str | None = None


@dataclass(frozen=True)
class RawLook:
    """Appearance of a body: meshes, and capsules for simple shapes."""

    meshes: Sequence[RawMesh] = ()
    capsules: Sequence[fit.Capsule] = ()


NOTHING_SEEN = RawLook()


@dataclass
class LinkLook:
    """Appearance of one link of a description, as plain data."""

    meshes: list[dict[str, Any]] = field(default_factory=list)
    shapes: list[dict[str, Any]] = field(default_factory=list)


def urdf_looks(file: XmlFile) -> dict[str, RawLook]:
    """Return the appearance of each link of a URDF, by name; what cannot be read is left out."""
    found = {}
    named = {
        material.get("name", ""): color
        for material in file.root.iter("material")
        if (color := _material_color(material)) is not None
    }
    for link in file.root.findall("link"):
        meshes: list[RawMesh] = []
        shapes: list[fit.Capsule] = []
        for visual in link.findall("visual"):
            geometry = visual.find("geometry")
            shape = geometry[0] if geometry is not None and len(geometry) else None
            rotation, position = _origin(visual.find("origin"))
            if shape is None:
                continue
            if shape.tag == "mesh":
                scale = numbers(shape.get("scale"), (1.0, 1.0, 1.0))
                material = visual.find("material")
                color = None if material is None else _material_color(material)
                if material is not None and len(material) == 0:
                    color = named.get(material.get("name", ""))
                name = shape.get("filename", "")
                meshes.append(RawMesh(name, rotation, position, scale, color))
            else:
                shapes += [each.moved(rotation, position) for each in _simple(shape)]
        found[link.get("name", "")] = RawLook(meshes, shapes)
    return found


def _material_color(material: ElementTree.Element) -> str | None:
    """Return the color of a URDF's material; None where it has a texture or no color."""
    color = material.find("color")
    if color is None or material.find("texture") is not None:
        return None
    values = numbers(color.get("rgba"), (math.nan, math.nan, math.nan, 1.0))
    return hex_color(values)


def hex_color(rgba: Array) -> str | None:
    """Return ``#RRGGBB`` of red, green and blue from 0 to 1; None where one is no number."""
    if not np.isfinite(rgba[:3]).all():
        return None
    levels = np.rint(255.0 * np.clip(rgba[:3], 0.0, 1.0)).astype(int)
    return "#" + "".join(f"{level:02x}" for level in levels)


def _simple(shape: ElementTree.Element) -> list[fit.Capsule]:
    radius, length = (numbers(shape.get(key), (0.0,))[0] for key in ("radius", "length"))
    size = 0.5 * numbers(shape.get("size"), (0.0, 0.0, 0.0))
    if shape.tag == "sphere" and radius > 0.0:
        return fit.of_sphere(float(radius))
    if shape.tag == "cylinder" and radius > 0.0:
        return fit.of_cylinder(float(radius), 0.5 * float(length))
    return fit.of_box(size) if shape.tag == "box" and bool((size > 0.0).all()) else []


def _origin(element: ElementTree.Element | None) -> tuple[Array, Array]:
    """Return the rotation and position of an ``origin``: about fixed x, then y, then z."""
    zero = (0.0, 0.0, 0.0)
    if element is None:
        return np.eye(3), np.zeros(3)
    angles = numbers(element.get("rpy"), zero)
    quaternion = np.empty(4)
    from_euler(angles, quaternion)
    return matrices_of_quaternions(quaternion), numbers(element.get("xyz"), zero)


def numbers(text: str | None, usual: Sequence[float]) -> Array:
    """Return the numbers of an attribute, as many as usual; the usual ones where it has not those."""
    try:
        values = np.array([float(part) for part in (text or "").split()])
    except ValueError:
        values = np.zeros(0)
    good = len(values) == len(usual) and bool(np.isfinite(values).all())
    return values if good else np.array(usual, dtype=float)


def link_looks(
    looks: Mapping[str, RawLook], frames: Mapping[str, Any], folder: Path
) -> dict[str, dict[str, Any]]:
    """Return the appearance of a description's links, as plain data, from the looks of the bodies of a file and the
    ``frames`` in which they are put together (``build.Frame``).

    Links without a mesh are left out: their collision shapes look better than nothing.
    """
    found: dict[str, LinkLook] = {}
    for name, raw in looks.items():
        frame = frames.get(name)
        if frame is None:
            continue
        look = found.setdefault(frame.link, LinkLook())
        for mesh in raw.meshes:
            look.meshes.append({
                "file": located(mesh.file, folder),
                "position": _tidy(frame.rotation @ mesh.position + frame.position),
                "orientation": _tidy(quaternions_of_matrices(frame.rotation @ mesh.rotation)),
                "scale": _tidy(mesh.scale),
                **({} if mesh.color is None else {"color": mesh.color}),
            })  # fmt: skip
        for capsule in raw.capsules:
            moved = capsule.moved(frame.rotation, frame.position)
            look.shapes.append({
                "start": _tidy(moved.start), "end": _tidy(moved.end), "radius": float(moved.radius),
            })  # fmt: skip
    return {
        name: {"meshes": look.meshes, "shapes": look.shapes}
        for name, look in found.items()
        if look.meshes
    }


def _tidy(values: Array) -> list[float]:
    return [float(value) for value in np.round(values, 9) + 0.0]
