"""The trials that ship: what each of them sets."""

from __future__ import annotations

from typing import Any

from ..hal.simulated.simulated_robot import SimulatorParameters
from ..planner.library.shipped import shipped_folder
from ..runtime.language.errors import AloftError
from ..runtime.loading.reading.files import settings_of


def trial_settings(trial: str, option: str = "--trial") -> dict[str, Any]:
    """What a trial sets. What only other trials set goes back to the simulator's defaults.

    Raises:
        AloftError: there is no such trial.
    """
    if not trial:
        return {}
    files = {file.stem: file for file in sorted((shipped_folder() / "trials").glob("*.yaml"))}
    if trial not in files:
        raise AloftError(f"{option} {trial}: there is {', '.join(files)}")
    defaults = SimulatorParameters().model_dump(mode="json", round_trip=True)
    found = {
        key: defaults[key.partition(".")[2]] for file in files.values() for key in settings_of(file)
    }
    return found | settings_of(files[trial])
