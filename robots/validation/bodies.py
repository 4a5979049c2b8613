"""Checks that every link is a body that can exist."""

from __future__ import annotations

import math

import numpy as np

from ..parts import Link
from .draft import Draft
from .faults import Path, number, vector

TRIANGLE = 1e-6
"""By how much, relative to the largest, principal moments may break the triangle inequality:
so much is rounding in published files."""


def check_bodies(draft: Draft) -> None:
    """Report masses, centres, inertias and shapes that no body can have.

    The base of a robot that is bolted to the world needs no mass: nothing moves it.
    """
    bolted = draft.data.get("base") if draft.data.get("base_joint") == "fixed" else None
    for k, link in draft.parts("links", Link):
        path: Path = ("links", k)
        empty = link.mass == 0.0 and not any(link.inertia)
        if empty and link.name == bolted:
            pass
        elif not (math.isfinite(link.mass) and link.mass > 0.0):
            draft.add(
                (*path, "mass"), f"link {link.name} has a mass of {number(link.mass)} kg",
                "a positive number of kg", number(link.mass),
                "mass: 0.1",
            )  # fmt: skip
        if not all(map(math.isfinite, link.com)):
            draft.add(
                (*path, "com"), f"link {link.name} has no centre of mass",
                "three finite numbers of m", vector(link.com),
            )  # fmt: skip
        if not empty:
            _check_inertia(draft, (*path, "inertia"), link)
        for i, shape in enumerate(link.shapes):
            values = (*shape.start, *shape.end, shape.radius)
            if not all(map(math.isfinite, values)) or shape.radius <= 0.0:
                draft.add(
                    (*path, "shapes", i), f"shape {i + 1} of link {link.name} is no capsule",
                    "finite ends and a positive radius [m]",
                    f"start {vector(shape.start)}, end {vector(shape.end)}, "
                    f"radius {number(shape.radius)}",
                )  # fmt: skip


def _check_inertia(draft: Draft, path: Path, link: Link) -> None:
    name, found = f"link {link.name}", vector(link.inertia)
    if not all(map(math.isfinite, link.inertia)):
        draft.add(path, f"{name} has no inertia", "six finite numbers of kg m^2", found)
        return
    xx, yy, zz, xy, xz, yz = link.inertia
    moments = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    shown = vector(moments.tolist())
    if moments[0] <= 0.0:
        draft.add(
            path, f"{name} has an inertia that no body has: a principal moment is not positive",
            "three positive principal moments", f"{found}, with principal moments {shown}",
        )  # fmt: skip
    elif moments[2] > (moments[0] + moments[1]) * (1.0 + TRIANGLE):
        draft.add(
            path,
            f"{name} has an inertia that no body has: "
            "a principal moment is larger than the sum of the others",
            "principal moments of which each is at most the sum of the others",
            f"{found}, with principal moments {shown}",
        )
