"""The tasks of the whole-body controller: small classes with an error, a Jacobian and gains each."""

from __future__ import annotations

from .angular_momentum import AngularMomentum
from .contact_points import ContactPoints
from .linear_momentum import LinearMomentum
from .posture import Posture
from .task import KernelTask, Situation, Task, TaskChoice
from .torso_orientation import TorsoOrientation

__all__ = [
    "AngularMomentum",
    "ContactPoints",
    "KernelTask",
    "LinearMomentum",
    "Posture",
    "Situation",
    "Task",
    "TaskChoice",
    "TorsoOrientation",
]
