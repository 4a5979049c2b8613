"""Physical constants that every model of the project shares."""

from __future__ import annotations

from typing import Final

GRAVITY: Final = 9.81
"""Acceleration of free fall [m/s^2], downwards along the world's z axis."""
