"""Weights and gains of the whole-body controller's own tasks in one kind of phase."""

from __future__ import annotations

from .tasks.angular_momentum import AngularGains
from .tasks.contact_points import ContactGains
from .tasks.linear_momentum import LinearGains
from .tasks.posture import PostureGains
from .tasks.torso_orientation import TorsoGains


class TaskGains(PostureGains, AngularGains, TorsoGains, LinearGains, ContactGains):
    """Weights and gains of all tasks in one kind of phase. Vectors are x, y, z: the world's for
    momentum, the body's for the torso."""
