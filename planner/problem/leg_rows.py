"""Points of the legs that must touch nothing in flight, and the rows of the ``air`` piece for them.

Left and right legs are kept apart by the torso's middle plane. A leg and the next one behind it on the same side are
kept apart by a plane across the torso, wherever it is: each point of the one is ahead of each point of the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise, product
from typing import Any

import numpy as np

from ..models.coordinates import Coordinates
from ..models.symbolic_model import SymbolicModel, base_rotation
from .obstacles import touching_sphere


def air_rows(
    model: SymbolicModel, coordinates: Coordinates, q: Any, w: Mapping[str, Any]
) -> list[Any]:
    """Return the heights, distances ahead and sides of the points."""
    import casadi as ca

    whole = coordinates.expand(q)
    frames = model.frames(whole, coordinates.limbs)
    left = base_rotation(whole[3:6])[:, 1]
    points = body_points(model, coordinates)
    places = [model.point(frames, *point) for point, _, _ in points]
    heights = [
        place[2] - radius - (ca.dot(w["ground"], ca.vertcat(1.0, place[:2])) if w else 0.0)
        for place, (_, radius, _) in zip(places, points, strict=True)
    ]
    sides = [
        sign * ca.dot(left, place - whole[0:3]) - radius
        for place, (_, radius, sign) in zip(places, points, strict=True)
    ]
    ahead = base_rotation(whole[3:6])[:, 0]
    gaps = [
        ca.dot(ahead, places[fore] - places[hind]) - points[fore][1] - points[hind][1]
        for fore, hind in fore_and_hind(model, coordinates)
    ]
    return [*heights, *(place[0] for place in places), *sides, *gaps]


HIP_JOINTS = 3
"""Joints above the knee. Of a leg with fewer than five the thigh counts, too: it ends in a ball, and its knee folds down."""


def body_points(model: SymbolicModel, coordinates: Coordinates
                ) -> list[tuple[tuple[str, tuple[float, float, float]], float, float]]:  # fmt: skip
    """Return the points of the legs that must not touch anything in flight, from the knee down: (link, place), radius
    and +1 for a left leg, -1 for a right one. Contact points first; only balls have a radius there.
    """
    robot = model.robot
    link_of = {foot.name: foot.link for foot in robot.feet}
    found = []
    for c in coordinates.contacts:
        contact = robot.contacts[c]
        place, radius = touching_sphere(robot, c)
        found.append(((link_of[contact.foot], place), radius))
    for limb in coordinates.limbs:
        joints = model.limbs[limb]
        for index in joints[min(HIP_JOINTS, len(joints) - 2) : -1]:
            link = robot.link(robot.joints[index].child)
            for shape in link.shapes:
                found += [((link.name, corner), shape.radius) for corner in shape.corners]
    sides = {limb: float(np.sign(_root(model, limb)[1])) for limb in range(len(model.limbs))}
    return [(point, radius, sides[model.limb_of_link[point[0]]]) for point, radius in found]


def fore_and_hind(model: SymbolicModel, coordinates: Coordinates) -> list[tuple[int, int]]:
    """Return pairs of ``body_points`` of a leg and of the next one behind it on the same side, indices: a plane across
    the torso keeps such legs apart if each point of the one is ahead of each point of the other.
    """
    points = body_points(model, coordinates)
    of_limb: dict[int, list[int]] = {}
    for i, (point, _, _) in enumerate(points):
        of_limb.setdefault(model.limb_of_link[point[0]], []).append(i)
    found = []
    for side in (-1.0, 0.0, 1.0):
        legs = [limb for limb in of_limb if np.sign(_root(model, limb)[1]) == side]
        legs.sort(key=lambda limb: -_root(model, limb)[0])
        for fore, hind in pairwise(legs):
            if _root(model, fore)[0] > _root(model, hind)[0]:
                found += list(product(of_limb[fore], of_limb[hind]))
    return found


def _root(model: SymbolicModel, limb: int) -> tuple[float, float, float]:
    """Return the place of a limb's first joint on the base [m]."""
    return model.robot.joints[model.limbs[limb][0]].origin
