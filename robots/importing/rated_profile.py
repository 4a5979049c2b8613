"""The actuator profile that a URDF or MJCF file implies.

These formats give each joint at most an effort and a speed. What they leave open is assumed here,
cautiously, and said in the notes: the torque falls from 0.6 of the speed limit on, and a motor bears
two fifths of its peak torque for long.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from ..validation.faults import listing
from .raw_model import RawJoint

NAME = "rated"
CORNER = 0.6
"""Corner speed as a share of the speed limit, which is taken for the no-load speed."""
CONTINUOUS = 0.4
"""Continuous torque as a share of the effort limit."""
EFFORT = 100.0
"""Peak torque [N m, N] where the file gives none."""
SPEED = 20.0
"""No-load speed [rad/s, m/s] where the file gives none."""
KEYS = ("peak_torque", "corner_speed", "no_load_speed", "continuous_torque", "rotor_inertia",
        "friction", "damping")  # fmt: skip


def rated_profile(
    joints: Mapping[str, RawJoint], is_urdf: bool, notes: list[str]
) -> dict[str, Any]:
    """The profile as plain data; joints that differ from most have an entry under ``motors``."""
    values = {name: _values(joint, is_urdf) for name, joint in joints.items()}
    efforts = [n for n, j in joints.items() if math.isnan(j.effort) or (is_urdf and j.effort <= 0)]
    speeds = [n for n, j in joints.items() if not j.speed > 0 and values[n]["peak_torque"] > 0]
    if efforts:
        notes.append(f"no effort limit of {listing(efforts, 6)}: {EFFORT:g} N m is assumed")
    if speeds:
        notes.append(f"no speed limit of {listing(speeds, 6)}: {SPEED:g} rad/s is assumed")
    driven = [value for value in values.values() if value["peak_torque"] > 0] or [
        {**dict.fromkeys(KEYS, 0.0), "peak_torque": EFFORT, "continuous_torque": EFFORT,
         "corner_speed": CORNER * SPEED, "no_load_speed": SPEED}
    ]  # fmt: skip
    common = {key: Counter(value[key] for value in driven).most_common(1)[0][0] for key in KEYS}
    if not 0.0 <= common["corner_speed"] < common["no_load_speed"]:
        common["corner_speed"] = CORNER * common["no_load_speed"]
    motors = {
        name: {key: value[key] for key in KEYS if value[key] != common[key]}
        for name, value in values.items()
    }
    return {**common, "motors": {name: changed for name, changed in motors.items() if changed}}


def _values(joint: RawJoint, is_urdf: bool) -> dict[str, float]:
    known = joint.effort > 0.0 or (joint.effort == 0.0 and not is_urdf)
    effort = joint.effort if known else EFFORT
    speed = joint.speed if joint.speed > 0.0 else SPEED
    return {
        "peak_torque": effort,
        "corner_speed": round(CORNER * speed, 9),
        "no_load_speed": speed,
        "continuous_torque": round(CONTINUOUS * effort, 9),
        "rotor_inertia": joint.rotor_inertia,
        "friction": joint.friction,
        "damping": joint.damping,
    }
