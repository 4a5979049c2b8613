"""The robot that the importer made of a URDF or MJCF file alone, as it is compared with other readings of that file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..importing.build import LinkTree
    from ..importing.raw_model import RawModel


@dataclass(frozen=True)
class FileRobot:
    """The robot that the importer made of a file alone.

    Attributes:
        model: what was read.
        built: the links and joints made of it.
        dynamics: Pinocchio's model of the description, with the rotors of the file.
        fixed_at: positions of joints that do not move here [rad, m], those of the file's own where it holds them.
    """

    model: RawModel
    built: LinkTree
    dynamics: Any
    fixed_at: Mapping[str, float]
