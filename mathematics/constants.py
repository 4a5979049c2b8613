"""Physical constants that every model of the project shares."""

from __future__ import annotations

from typing import Final

GRAVITY: Final = 9.81
"""Acceleration of free fall [m/s^2], downwards along the world's z axis."""

COPPER: Final = 0.0039
"""Relative growth of the resistance of copper per kelvin, of its value at 25 deg C [1/K]."""

MAGNETS: Final = 0.0012
"""Relative weakening of neodymium-iron-boron magnets per kelvin [1/K]; data sheets: 0.0011 to
0.0012."""
