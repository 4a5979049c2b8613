"""The margins that a plan leaves to the feedback: bounds narrower than the robot's limits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...runtime.language.parameters import Parameters, parameter

LIMIT_MARGIN = 0.005
"""Margin of a joint's limit [rad]; between two knots a joint at its limit would pass it by about as much."""


class Margins(Parameters):
    """Bounds that keep a plan away from states in which the feedback could not correct a disturbance.

    A plan that may do anything crouches until the torso lies on the thighs, pushes with the very
    ends of the feet, lands on straight legs and turns joints up to their stops. Each of these is
    optimal and none can be followed with noise, delay and a model that is not quite true.
    """

    squat_lean: float | None = parameter(
        None, unit="rad", ge=0.1, le=1.5,
        text="largest lean of the torso forwards or backwards until lift-off; None: any",
    )  # fmt: skip
    landing_lean: float | None = parameter(
        None, unit="rad", ge=0.01, le=1.5,
        text="largest lean of the torso from touchdown on; None: any",
    )  # fmt: skip
    joints: float = parameter(
        LIMIT_MARGIN, unit="rad", ge=0.0, le=0.5, text="distance of the joints from their limits"
    )
    landing_limits: Mapping[str, tuple[float, float]] = parameter(
        {}, unit="rad",
        text="narrower limits of joints from touchdown on, by a joint's name or by the part of it that "
        "both sides share, such as knee: [-120 deg, -25 deg]",
    )  # fmt: skip
    step: float | None = parameter(
        None, unit="m", ge=0.0, le=0.1,
        text="least gap between calves and a step, and between feet and its edge where they pass "
        "it; of legs that end in balls also between them and the ground, and above the base's height that counts "
        "as a fall; None: 2 mm for calves, no bound for feet",
    )  # fmt: skip
    pressure: float = parameter(
        0.0, ge=0.0, lt=0.5, text="least share of a foot's load on each of its contact points"
    )
    load: float | None = parameter(
        None, ge=0.0, lt=1.0,
        text="least share of the robot's weight that the ground bears until lift-off, alike at every contact "
        "point that touches it; None: a contact point may bear nothing",
    )  # fmt: skip
    lift_off_speed: float | None = parameter(
        None, unit="m/s", gt=0.0, le=20.0,
        text="least vertical speed of the centre of mass at lift-off, in a jump that is given by its rise; None: any",
    )  # fmt: skip
    touchdown_speed: float | None = parameter(
        None, unit="m/s", gt=0.0, le=20.0,
        text="largest downward speed of a contact point where it hits the ground with an impact; "
        "None: any",
    )  # fmt: skip
    touchdown_slide: float | None = parameter(
        None, unit="m/s", gt=0.0, le=20.0,
        text="its largest speed there along the foot, and across it; None: any",
    )  # fmt: skip
    landing_effort: float | None = parameter(
        None, gt=0.0, le=1.0,
        text="share of the motors' torque and speed that the plan may use from touchdown on; None: "
        "the task's effort",
    )  # fmt: skip


def unknown_joints(margins: Margins, names: list[str]) -> list[str]:
    """Return the keys of ``landing_limits`` that no joint has."""
    return [key for key in margins.landing_limits if not any(_means(key, name) for name in names)]


def joint_bounds(robot: RobotDescription, margins: Margins, landed: bool) -> Array:
    """Return the joints' limits in a plan [rad], (n_joints, 2)."""
    bounds = robot.joint_limits + np.array([margins.joints, -margins.joints])
    if landed:
        for key, (low, high) in margins.landing_limits.items():
            for i, joint in enumerate(robot.joints):
                if _means(key, joint.name):
                    bounds[i] = max(bounds[i, 0], low), min(bounds[i, 1], high)
    return np.asarray(bounds)


def _means(key: str, joint: str) -> bool:
    return joint == key or joint.endswith(f"_{key}")
