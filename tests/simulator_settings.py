"""Puts parameters of the simulator into their groups, for tests that name each by its own name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.runtime.language.parameters import group_of


def _groups() -> dict[str, str]:
    """The group of every parameter that is in one."""
    found: dict[str, str] = {}
    for group, info in SimulatorParameters.model_fields.items():
        model = group_of(info)
        if model is not None and group != "motor_model":
            assert not found.keys() & model.model_fields.keys(), "a name is in two groups"
            found |= dict.fromkeys(model.model_fields, group)
    return found


def grouped(settings: Mapping[str, Any]) -> dict[str, Any]:
    """``{"gyro_noise": 0.02, "seed": 1}`` becomes ``{"sensors": {"gyro_noise": 0.02}, "seed": 1}``.

    What is in its group already stays there.
    """
    groups, found = _groups(), dict[str, Any]()
    for name, value in settings.items():
        if name in groups:
            found[groups[name]] = {**found.get(groups[name], {}), name: value}
        elif name in groups.values():
            found[name] = {**value, **found.get(name, {})}
        else:
            found[name] = value
    return found
