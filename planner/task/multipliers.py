"""The Lagrange multipliers of a planned jump, from which the solver of a like task begins, and their file.

They are no part of a plan's own file: they say nothing about the motion, and a plan is as good
without them. They lie beside it, in a folder of their own under the hash of its task.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...mathematics.arrays import Array
from .whole_file import write_whole

FOLDER = "multipliers"
"""The folder, within a library's, that holds them."""


@dataclass(frozen=True)
class Multipliers:
    """The multipliers with which a solver ended.

    Attributes:
        values: in the solver's own order: of equations, of lower and of upper bounds.
        structure: of the problem they belong to; they mean something only where it is the same.
    """

    values: Array
    structure: str


def multipliers_path(folder: Path, task_hash: str) -> Path:
    """The file for a plan in a library's folder."""
    return folder / FOLDER / f"{task_hash}.npz"


def write_multipliers(path: Path, multipliers: Multipliers) -> Path:
    """Write the file as a whole or not at all. Single precision is more than a start needs."""
    memory = io.BytesIO()
    np.savez_compressed(
        memory,
        values=multipliers.values.astype(np.float32),
        structure=np.array(multipliers.structure),
    )
    return write_whole(path, memory.getvalue())


def read_multipliers(path: Path) -> Multipliers | None:
    """What the file holds; ``None`` where there is none or it is damaged: the solver then begins
    without them."""
    try:
        with np.load(path, allow_pickle=False) as file:
            values, structure = file["values"].astype(np.float64), str(file["structure"])
    except Exception:  # noqa: BLE001  # a damaged archive raises nearly anything
        return None
    return Multipliers(values, structure) if np.isfinite(values).all() else None
