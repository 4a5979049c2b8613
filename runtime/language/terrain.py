"""The ground that a block knows of, such as a simulated world's: for pictures, never for control."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Ground:
    """A block of ground with faces along the world's axes: its ``least`` and ``most`` corners
    [m, world] as x, y, z."""

    least: tuple[float, float, float]
    most: tuple[float, float, float]


@dataclass(frozen=True)
class Terrain:
    """A level floor at height ``floor`` [m, world], and blocks that stand on it."""

    floor: float = 0.0
    blocks: tuple[Ground, ...] = ()
