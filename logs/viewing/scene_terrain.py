"""The ground in the scene: steps, platforms, and a floor that is not at height zero."""

from __future__ import annotations

import numpy as np

from .scene_part import Moments, ScenePart

COLOR = 0x8D9299FF
FLOOR_SIZE = 4.0
"""Length and width of the piece of floor that is drawn [m]."""
FLOOR_THICKNESS = 0.02
DEEPEST_FLOOR = -10.0
"""A floor below this height [m] is out of reach, and so not drawn."""


class TerrainPart(ScenePart):
    """``ground``: the boxes of the scene, drawn once. A level floor at height zero is not drawn,
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
        self.log(
            "ground",
            rr.Boxes3D(
                centers=places.mean(axis=1),
                half_sizes=0.5 * (places[:, 1] - places[:, 0]),
                colors=np.full(len(places), COLOR, np.uint32),
                fill_mode="solid",
            ),
        )

    def write(self, moments: Moments) -> None:
        """Nothing: the ground does not move."""
