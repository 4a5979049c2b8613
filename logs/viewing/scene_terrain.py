"""The ground in the scene: steps, platforms, and a floor that is not at height zero."""

from __future__ import annotations

import numpy as np

from .scene_part import Moments, ScenePart

COLOR = 0x8D9299FF
EDGES = 0xCFD8DCFF
"""The edges of the boxes: all their sides have one colour, so a step would not be seen without."""
FLOOR_SIZE = 4.0
"""Length and width of the piece of floor that is drawn [m]."""
FLOOR_THICKNESS = 0.02
DEEPEST_FLOOR = -10.0
"""A floor below this height [m] is out of reach, and so not drawn."""


class TerrainPart(ScenePart):
    """``ground``: the boxes of the scene with their edges, drawn once. A level floor at height zero is not drawn,
    as the viewer has a grid there."""

    def write_static(self) -> None:
        """Write the boxes."""
        import rerun as rr

        terrain = self.header.terrain
        if terrain is None:
            return
        corners = [(block.least, block.most) for block in terrain.blocks]
        if DEEPEST_FLOOR < terrain.floor < 0.0:
            half = 0.5 * FLOOR_SIZE
            corners.append(
                ((-half, -half, terrain.floor - FLOOR_THICKNESS), (half, half, terrain.floor))
            )
        if not corners:
            return
        places = np.array(corners)
        centers, half_sizes = places.mean(axis=1), 0.5 * (places[:, 1] - places[:, 0])
        for name, color, mode in (
            ("ground", COLOR, "solid"),
            ("ground/edges", EDGES, "majorwireframe"),
        ):
            boxes = rr.Boxes3D(
                centers=centers,
                half_sizes=half_sizes,
                colors=np.full(len(places), color, np.uint32),
                radii=np.full(len(places), 0.003 * self.scale),
                fill_mode=mode,
            )
            self.log(name, boxes)

    def write(self, moments: Moments) -> None:
        """Nothing: the ground does not move."""
