"""Settings of the shipped trials: physics, sensors and variation that a graph is run under."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..hal.simulated.parameters import SimulatorParameters
from ..planner.library.library import shipped_folder
from ..runtime.language.errors import AloftError
from ..runtime.loading.reading.files import settings_of


def trial_settings(trial: str) -> dict[str, Any]:
    """Return the settings of a trial. What only other trials set goes back to the simulator's
    defaults.

    Raises:
        AloftError: there is no such trial.
    """
    if not trial:
        return {}
    files = {file.stem: file for file in sorted((shipped_folder() / "trials").glob("*.yaml"))}
    if trial not in files:
        raise AloftError(f"--trial {trial}: there is {', '.join(files)}")
    defaults = SimulatorParameters().model_dump(mode="json", round_trip=True)
    found = {
        key: value
        for file in files.values()
        for key, value in (_default(key, defaults) for key in settings_of(file))
    }
    # a group that may be left out goes back as a whole, before what is set within it
    return found | settings_of(files[trial])


def _default(key: str, defaults: Mapping[str, Any]) -> tuple[str, Any]:
    """Return the key of a trial's setting, or of the group around it that is left out by default, and the default."""
    block, *names = key.split(".")
    value: Any = defaults
    for depth, name in enumerate(names, 1):
        value = value[name]
        if not isinstance(value, dict):
            return ".".join([block, *names[:depth]]), value
    return key, value
