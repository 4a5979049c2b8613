"""The feet that carry load, of those with contact points that do."""

from __future__ import annotations

from .arrays import Array1D, Array2D, Flags1D, Indices1D
from .kernel import kernel


@kernel
def has_contact(contact: Flags1D, foot_of_point: Indices1D, foot: int) -> bool:
    """Return whether a foot has a point in ``contact``; the arguments are those of
    ``find_stance_feet``."""
    found = False
    for point in range(contact.shape[0]):
        found = found or (bool(contact[point]) and foot_of_point[point] == foot)
    return found


@kernel
def find_stance_feet(contact: Flags1D, foot_of_point: Indices1D, stands: Flags1D) -> int:
    """Write which feet have a point in ``contact``, or that all have where none is; returns their number.

    Args:
        contact: of each contact point, (n_contacts,).
        foot_of_point: the foot of each contact point, (n_contacts,).
        stands: the result, (n_feet,).
    """
    count = 0
    for foot in range(stands.shape[0]):
        stands[foot] = has_contact(contact, foot_of_point, foot)
        count += 1 if stands[foot] else 0
    if count == 0:
        stands[:] = True
        count = stands.shape[0]
    return count


@kernel
def mean_position(points: Array2D, chosen: Flags1D, count: int, out: Array1D) -> None:
    """Compute the mean (3,) of the ``count`` chosen ones of points (n, 3)."""
    out[:] = 0.0
    for i in range(points.shape[0]):
        if chosen[i]:
            out[:] += points[i] / count
