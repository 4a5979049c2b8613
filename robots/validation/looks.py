"""Checks of what links are drawn as. A mesh that is not there is no fault: the robot runs without."""

from __future__ import annotations

import math

from ..parts import Look
from .draft import Draft, read


def check_looks(draft: Draft) -> None:
    """Report looks of unknown links, and meshes that would be nowhere or have no direction."""
    links = draft.names("links")
    for name, value in draft.entries("looks"):
        if name not in links:
            draft.unknown(("looks", name), "the link of a look", name, "link", links)
        look = read(Look, value)
        for k, mesh in enumerate(look.meshes if look is not None else ()):
            numbers = (*mesh.position, *mesh.orientation, *mesh.scale)
            path = ("looks", name, "meshes", k)
            if not all(map(math.isfinite, numbers)):
                draft.add(path, f"a mesh of link {name} is nowhere", "finite numbers", "others")
            elif not any(mesh.orientation):
                draft.add(
                    (*path, "orientation"), f"a mesh of link {name} has no orientation",
                    "a quaternion x, y, z, w that is not zero", str(list(mesh.orientation)),
                    "orientation: [0, 0, 0, 1]",
                )  # fmt: skip
