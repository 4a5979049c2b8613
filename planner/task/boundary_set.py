"""What the formulations ``paper`` and ``srbm`` know of a task, and bounds that only the paper's has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeVar

from ...runtime.language.parameters import Parameters, parameter

Task = TypeVar("Task", bound=Parameters)
"""A ``JumpTask``; its module imports this one."""


class BoundarySet(Parameters):
    """Bounds of the paper's set Q (III-B) beside those that other keys of a task give.

    The paper's problem has no motors. Bounds on speeds and forces are what it has in their place.
    """

    joint_velocity: float | None = parameter(
        None, unit="rad/s", gt=0.0, le=200.0, text="largest speed of every joint; None: any"
    )
    force: float | None = parameter(
        None, unit="N", gt=0.0, le=1e4, text="largest normal force on a contact point; None: any"
    )
    angular_momentum: float | None = parameter(
        None, unit="N*m*s", ge=0.0, le=20.0,
        text="largest angular momentum about the centre of mass, at any time, about each axis; None: any",
    )  # fmt: skip


_FULL_ONLY = (
    "impact", "effort", "foot_clearance", "leg_clearance", "gap", "step_edge", "slope", "landing_slope", "rough",
    "stairs", "jumps", "repeat", "contact_time", "weights.acceleration",
    "weights.impulse", "margins.step", "margins.pressure", "margins.load", "margins.lift_off_speed",
    "margins.touchdown_speed", "margins.touchdown_slide", "margins.landing_effort",
)  # fmt: skip
_PAPER_TOO = (
    "margins.squat_lean", "margins.landing_lean", "margins.joints", "margins.landing_limits", "touchdown_lean",
    "lift_off_momentum", "touchdown_momentum", "phases", "take_off", "touchdown",
)  # fmt: skip
UNSUPPORTED: dict[str, tuple[str, ...]] = {
    "full": ("bounds",),  # it has the motors themselves
    "paper": _FULL_ONLY,
    "srbm": (*_FULL_ONLY, *_PAPER_TOO, "bounds", "weights.posture", "weights.joint_velocity"),
}
"""Keys of a task that a formulation has nothing for, by the formulation."""


def unsupported_keys(task: Any) -> Iterator[str]:
    """Yield the keys that the task sets, to something else than their default, and its formulation has nothing for."""
    for key in UNSUPPORTED[task.formulation]:
        group, _, name = key.rpartition(".")
        owner: Any = getattr(task, group) if group else task
        if owner is None or name not in owner.model_fields_set:
            continue
        if getattr(owner, name) != type(owner).model_fields[name].default:
            yield key


def in_formulation(task: Task, formulation: str) -> tuple[Task, list[str]]:
    """Return the task in another formulation, without the keys that it has nothing for, and these keys."""
    found = task.model_copy(update={"formulation": formulation})
    left_out = list(unsupported_keys(found))
    for key in left_out:
        group, _, name = key.rpartition(".")
        owner: Any = getattr(found, group) if group else found
        default = type(owner).model_fields[name].default
        changed = owner.model_copy(update={name: default})
        found = found.model_copy(update={group: changed}) if group else changed
    return found, left_out
