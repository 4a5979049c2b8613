"""The ground of a block's world, such as a simulator's: for pictures, never for control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@dataclass(frozen=True)
class Ground:
    """A box of ground whose faces are normal to the world's axes, given by its ``least`` and
    ``most`` corners x, y, z [m, world]."""

    least: tuple[float, float, float]
    most: tuple[float, float, float]


@dataclass(frozen=True)
class Terrain:
    """A level floor at height ``floor`` [m, world], and boxes that stand on it."""

    floor: float = 0.0
    blocks: tuple[Ground, ...] = ()

    def height(self, x: float, y: float) -> float:
        """The height [m, world] of the highest surface at that place."""
        height = self.floor
        for block in self.blocks:
            (x0, y0, _), (x1, y1, top) = block.least, block.most
            if top > height and x0 <= x <= x1 and y0 <= y <= y1:
                height = top
        return height


@runtime_checkable
class SupportsScene(Protocol):
    """Parameters of a block whose world has ground; recordings draw it."""

    def build_scene(self) -> Terrain:
        """The ground that these parameters describe."""
