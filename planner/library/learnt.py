"""Lessons of a robot's own jumps, kept in a small file that belongs to this robot.

After each jump the recording says how far it landed from its place, and how the torso tilted. From this
follows the correction of velocity and angular momentum at lift-off that this jump would have needed
(``studies/rehearsing/learning``): a ``Lesson``. The correction of the next jump is the mean of a Gaussian
process through all lessons, over what the jump is to do at lift-off, its ``Launch``. So a jump profits
most from the last ones like it, and a new one from all that are near it::

    c = k' (K + N)^-1 C,   N = NOISE^2 diag(FORGETTING^-age)
    k(a, b) = SHARED g(a - b, FAR) + (1 - SHARED) g(a - b, NEAR),   g(d, r) = exp(-|d|^2 / (2 r^2))

with the needed corrections C, one row a lesson, and ages in jumps.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.constants import GRAVITY
from ...mathematics.linear_algebra import inverse, product
from ...runtime.language.errors import AloftError
from ..task.files import write_whole
from ..task.task import JumpTask
from .rehearsed import ZERO, Vector, read_vector

FORMAT = 1
SHARED = 0.7
"""The share of a correction that is much the same for jumps that are only alike."""
NEAR, FAR = 0.25, 1.5
"""Launches that differ by less than this [m/s] are the same jump, and are alike."""
NOISE = 0.5
"""Scatter of one lesson, as a share of what robots need."""
FORGETTING = 0.9
"""Factor by whose inverse a lesson's variance of noise grows with each further jump."""
MOST = 40
"""Lessons that are kept, the last ones."""
LARGEST = 0.15
"""The largest correction of a lesson along each axis [m/s]; of the angular momentum this speed at the
lever of ``studies/rehearsing/lift_off``."""
TURNING_ARM = 0.1
"""A turn of the whole robot differs from none as this arm's speed does [m]."""

Launch = tuple[float, float, float, float]
"""The velocity of the centre of mass at lift-off, and the speed of turning at ``TURNING_ARM`` [m/s]."""


class LearntFileError(AloftError):
    """The file of what a robot has learnt is damaged, or another robot's."""


@dataclass(frozen=True)
class Lesson:
    """One jump of the robot.

    Attributes:
        task: what it was to do.
        launch: what this means at lift-off.
        velocity, momentum: the correction that it would have needed [m/s, N m s, the plan's axes].
        place: how far it landed beside its place, ahead and to the left [m].
        tilt: how far the torso tilted after touchdown, in roll and pitch, and by how much it missed
            its heading [rad].
    """

    task: str
    launch: Launch
    velocity: Vector
    momentum: Vector
    place: tuple[float, float]
    tilt: Vector


@dataclass(frozen=True)
class LearntJumps:
    """The lessons of one robot, the last one last."""

    robot: str
    lessons: tuple[Lesson, ...] = ()

    def correction(self, launch: Launch | None) -> tuple[Vector, Vector]:
        """Return the corrections of velocity and angular momentum for a jump."""
        if launch is None or not self.lessons:
            return ZERO, ZERO
        launches = np.array([lesson.launch for lesson in self.lessons])
        needed = np.array([lesson.velocity + lesson.momentum for lesson in self.lessons])
        ages = np.arange(len(launches))[::-1]
        gram = similarity(launches[:, None] - launches) + np.diag(NOISE**2 / FORGETTING**ages)
        weights = product(inverse(gram), similarity(launches - np.array(launch)))
        x, y, z, kx, ky, kz = product(weights, needed).round(5).tolist()
        return (x, y, z), (kx, ky, kz)

    def with_lesson(self, lesson: Lesson) -> LearntJumps:
        """Return these and one more; more than ``MOST`` are not kept."""
        return LearntJumps(self.robot, (*self.lessons, lesson)[-MOST:])


def similarity(differences: Any) -> Any:
    """Return the similarity of launches with these differences (..., 4), from 0 to 1."""
    square = -0.5 * (differences**2).sum(axis=-1)
    return SHARED * np.exp(square / FAR**2) + (1.0 - SHARED) * np.exp(square / NEAR**2)


def launch_of(task: JumpTask) -> Launch | None:
    """Return the launch of a task at lift-off, by the first jump of a row; ``None`` for somersaults and rows of jumps
    that differ.
    """
    hops, end = task.hops(), task.places()[1]
    hop = hops[0]
    if hop.rotation or any(other != hop for other in hops):
        return None
    if hop.rise is not None:
        upwards = math.sqrt(2.0 * GRAVITY * hop.rise)
        fall = math.sqrt(2.0 * GRAVITY * max(hop.rise - end.z, 0.0))
        flight = (upwards + fall) / GRAVITY
    elif hop.flight_time is not None:
        flight = hop.flight_time
        upwards = 0.5 * GRAVITY * flight + end.z / flight
    else:
        return None
    turning = TURNING_ARM * end.heading / flight
    return end.x / flight, end.y / flight, upwards, turning


def read_learnt(path: Path, robot: str) -> LearntJumps:
    """Return the lessons of a robot.

    Raises:
        LearntFileError: there is no such file, it is damaged, or is another robot's.
    """
    try:
        data = json.loads(path.read_text("utf-8"))
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']}, not {FORMAT}")
        found = LearntJumps(str(data["robot"]), tuple(_lesson(each) for each in data["lessons"]))
    except FileNotFoundError:
        raise LearntFileError(
            f"{path}: there is no such file; `aloft jump --learn {path.name}` begins it"
        ) from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise LearntFileError(
            f"{path}: expected what a robot has learnt, found a damaged file "
            f"({type(error).__name__}: {error}); remove it, and learn anew"
        ) from error
    if found.robot != robot:
        raise LearntFileError(f"{path}: this was learnt by {found.robot}, not by {robot}")
    return found


def write_learnt(path: Path, learnt: LearntJumps) -> None:
    """Write what a robot has learnt; the file is replaced as a whole."""
    text = json.dumps({"format": FORMAT, **asdict(learnt)}, indent=1) + "\n"
    write_whole(path, text.encode())


def _lesson(data: Any) -> Lesson:
    launch, place = _numbers(data["launch"], 4), _numbers(data["place"], 2)
    return Lesson(
        str(data["task"]), (launch[0], launch[1], launch[2], launch[3]),
        read_vector(data["velocity"]), read_vector(data["momentum"]),
        (place[0], place[1]), read_vector(data["tilt"]),
    )  # fmt: skip


def _numbers(values: Any, count: int) -> Sequence[float]:
    found = [float(value) for value in values]
    if len(found) != count or not all(abs(value) < 1e6 for value in found):
        raise ValueError(f"{values} is not {count} finite numbers")
    return found
