"""The words of a ROS 2 message on its own numbers: their frame, whose they are, and which are there.

A header names the frame of the numbers beside it, ``child_frame_id`` the frame that a transform or a
velocity belongs to, and a covariance that begins with -1 says that a value is not there. A quaternion has
length one; all zeros are what a message has that nobody filled in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array

WORLDS = ("world", "map", "odom")
"""Names that ROS 2 has for frames that stand on the ground; see REP 105."""
BODIES = ("base_link", "base", "body", "base_footprint")
"""Names that it has for the robot's base, beside that of the description."""
ROUNDING = 0.01
"""A quaternion whose length differs from one by more than this is none."""
Texts = Mapping[str, str | Sequence[str]]


class WrongMessageError(ValueError):
    """A message does not fit the signal: a list of another length, another frame, a name that is missing."""


class OtherMessageError(Exception):
    """A message is for others: it has none of the transforms that the signal has."""


def governing_text(path: Sequence[str], frame: str, texts: Iterable[str]) -> str | None:
    """Return the path of the text that names the frame of the numbers at ``path``, if there is one.

    It is the ``frame_id`` of the header nearest to them, or for velocities in the body the
    ``child_frame_id`` beside it.
    """
    known = set(texts)
    for k in range(len(path) - 1, -1, -1):
        names = ["child_frame_id"] if frame == "body" else []
        for name in (*names, "header.frame_id"):
            found = ".".join([*path[:k], name])
            if found in known:
                return found
    return None


@dataclass(frozen=True)
class FrameNames:
    """The names that frames have in messages.

    Attributes:
        base: the robot's base link; empty without a robot.
        links: all links of the robot.
        given: the texts of the graph by their path; ``frame_id`` stands for every header.
    """

    base: str = ""
    links: tuple[str, ...] = ()
    given: Texts | None = None

    def expected(self, path: str) -> str | None:
        """Return the name that the graph gives for a text, if it gives one."""
        given = self.given or {}
        found = given.get(path, given.get("frame_id") if path.endswith("frame_id") else None)
        if path.endswith("child_frame_id") and path not in given:
            return None
        return found if isinstance(found, str) else None

    def is_frame(self, name: str, frame: str, path: str) -> bool:
        """Return whether numbers whose frame is called ``name`` are in the signal's ``frame``.

        An empty name says nothing. In the body are all frames that are not known to be others.
        """
        name = name.lstrip("/")
        given = self.expected(path)
        if not name or given is not None:
            return not name or name == (given or "").lstrip("/")
        if frame == "world":
            return name in WORLDS
        if frame == "body":
            return name == self.base or (name not in WORLDS and name not in self.links)
        return name == frame

    def is_known(self, name: str, frame: str, path: str) -> bool:
        """Return whether nothing is assumed where ``is_frame`` holds."""
        name = name.lstrip("/")
        sure = not name or frame != "body" or self.expected(path) is not None
        return sure or name == self.base or name in BODIES


def unclear_frame(given: str, frame: str, base: str) -> bool:
    """Return whether a header's name that the graph gives contradicts the frame that the type has."""
    if frame == "world":
        return given.lstrip("/") not in WORLDS
    return frame == "body" and given.lstrip("/") in WORLDS and given != base


def is_absent(owner: Any, field: str) -> bool:
    """Return whether a message says that it has no value of the field: a covariance that begins with -1."""
    covariance = getattr(owner, f"{field}_covariance", None)
    return covariance is not None and len(covariance) > 0 and float(covariance[0]) == -1.0


def unit_quaternions(values: Array, path: str) -> Array:
    """Return quaternions (..., 4) of length one.

    Raises:
        WrongMessageError: one has another length; those that are not finite are left to the caller.
    """
    length = np.sqrt(np.sum(values * values, axis=-1, keepdims=True))
    wrong = np.abs(length - 1.0) > ROUNDING
    if wrong.any():
        raise WrongMessageError(
            f"{path} is no rotation: its length is {length[wrong][0]:.4g}, not 1"
        )
    exact = np.abs(length - 1.0) < 1e-12  # the bytes that were sent
    return np.asarray(np.where(exact, values, values / np.where(length > 0.0, length, 1.0)))


def sent_quaternion(value: NDArray[Any]) -> NDArray[Any]:
    """Return a quaternion (4,) as it is sent: of length one, and no turn for zeros."""
    square = float(np.dot(value, value))
    if square == 0.0 or not np.isfinite(square):
        return np.array([0.0, 0.0, 0.0, 1.0])
    return value if abs(square - 1.0) < 1e-9 else value / np.sqrt(square)
