"""Differences of two readings of a robot: by how much at most, which are errors, and which are on purpose."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ..validation import DescriptionError

STATES = 3
"""Random states at which mass matrix and bias forces are compared."""
SAME = 1e-7
"""Share by which two readings may differ: a description has eleven digits, and products of a tensor fewer."""
FIX = "this is a mistake of the importer, not of the file: please report it with the file"


@dataclass
class Differences:
    """The comparison of an import with one program's reading of the file.

    Attributes:
        judge: the program, such as ``MuJoCo``.
        largest: the largest difference, as a share of the size of what is compared; where it is, in ``where``.
        errors: differences that nothing explains, with both numbers.
        named: kinds of differences that are on purpose.
        compared: how many quantities were compared.
        why: why the program does not read the file; empty where it does.
    """

    judge: str
    largest: float = 0.0
    where: str = ""
    errors: list[DescriptionError] = field(default_factory=list)
    named: dict[str, None] = field(default_factory=dict)
    compared: int = 0
    why: str = ""

    def name(self, kind: str) -> None:
        """Note that there is a difference of a kind that is on purpose."""
        self.named[kind] = None

    def compare(
        self, what: str, ours: Any, theirs: Any, size: float | None = None, share: float = SAME
    ) -> None:
        """Compare a quantity, a number or an array of any shape.

        Args:
            what: its name in an error, such as ``mass of link thigh [kg]``.
            ours, theirs: its values.
            size: what a difference is a share of; by default the largest of the values.
            share: that is allowed.
        """
        mine, other = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
        self.compared += 1
        equal = mine == other  # infinities are
        with np.errstate(invalid="ignore"):
            away = np.where(equal, 0.0, np.abs(mine - other))
        if size is None:
            finite = np.concatenate([mine.ravel(), other.ravel()])
            finite = finite[np.isfinite(finite)]
            size = float(np.abs(finite).max(initial=0.0))
        if not away.size:
            return
        worst = float(np.nan_to_num(away, nan=np.inf).max())
        relative = worst / size if size > 0.0 else worst
        message = f"the {what} is another one than in {self.judge}'s reading of the file"
        if relative > share and any(each.message.startswith(message) for each in self.errors):
            return  # at another random state
        if relative > share:
            where = np.unravel_index(int(np.nan_to_num(away, nan=np.inf).argmax()), away.shape)
            place = f", element {', '.join(str(int(k) + 1) for k in where)}" if away.ndim else ""
            self.errors.append(
                DescriptionError(
                    (), f"{message}{place}",
                    f"{float(other[where]):.9g} as in {self.judge}", f"{float(mine[where]):.9g}", FIX,
                )
            )  # fmt: skip
        elif relative > self.largest:
            self.largest, self.where = relative, what


def summary(compared: Iterable[Differences]) -> list[str]:
    """Return a sentence for each program that read the file: by how much what was imported differs, and what on purpose."""
    found = []
    for each in compared:
        if each.why:
            continue
        named = f"; on purpose: {'; '.join(each.named)}" if each.named else ""
        what = f", of the {each.where}" if each.where else ""
        found.append(
            f"compared with {each.judge}'s reading of the file: {each.compared} quantities, largest difference "
            f"{each.largest:.1e}{what}{named}"
        )
    return found


def unread(compared: Iterable[Differences]) -> list[str]:
    """Return a note for each program that did not read the file, so that nothing was compared with it."""
    return [
        f"not compared with {each.judge}, which does not read the file: {each.why}"
        for each in compared
        if each.why
    ]


def together(bodies: Sequence[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Return mass [kg], first moment of mass [kg m] (3,) and inertia [kg m^2] (3, 3) about the origin of bodies with
    mass, CoM and inertia about it, all in one frame."""
    mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for each, com, own in bodies:
        mass, moment = mass + each, moment + each * com
        inertia = inertia + own + each * (com @ com * np.eye(3) - np.outer(com, com))
    return mass, moment, inertia
