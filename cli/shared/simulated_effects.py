"""The effects that a simulated robot can have, for ``aloft robot show --effects``.

Parameters, units and defaults are those of the simulator's own models; what the trials ``real`` and
``warm`` set, and the source behind it, are values and comments of their files and of the trials they include.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from pydantic.fields import FieldInfo

from ...files.document import read_file
from ...files.nodes import MapNode, plain
from ...files.problems import Problems
from ...files.validation import unit_of
from ...hal.simulated import effects
from ...hal.simulated.parameters import SimulatorParameters
from ...planner.library.library import shipped_folder
from ...runtime.language.parameters import Parameters, group_of

TRIAL = "warm"
"""The trial whose sizes are shown: ``real``, and what it adds."""
ROBOT = "robot."
"""Prefix of the trials' keys for the simulated robot."""


class TrialSetting(NamedTuple):
    """A setting of a trial, as it is written, and the comment behind it."""

    value: Any
    source: str


def simulated_effects() -> list[dict[str, Any]]:
    """Return every parameter of an effect: ``group``, ``parameter``, ``text``, ``unit``,
    ``default``, the value of ``TRIAL`` (``trial``, ``None`` if it sets nothing) and ``source``.

    Groups are those of the simulator's parameters that ``hal/simulated/effects.py`` declares. Of its other
    parameters those count as effects that the trial sets.
    """
    settings = commented_settings(TRIAL)
    rows, alone = [], []
    for place, owner, off in _groups(SimulatorParameters, "", False):
        for name, info in owner.model_fields.items():
            if group_of(info) is not None:
                continue
            if owner.__module__ == effects.__name__:
                rows.append(_row(place, name, info, settings, off))
            elif f"{place}.{name}" in settings or (not place and name in settings):
                alone.append(_row(place, name, info, settings))
    return alone + rows


def commented_settings(trial: str) -> dict[str, TrialSetting]:
    """Return a shipped trial's settings of the simulated robot, by the parameter's path below
    ``robot``."""
    file = shipped_folder() / "trials" / f"{trial}.yaml"
    return {
        key.removeprefix(ROBOT): setting
        for key, setting in _read(file).items()
        if key.startswith(ROBOT)
    }


def _read(file: Path) -> dict[str, TrialSetting]:
    problems = Problems()
    node = read_file(file, file.name, problems)
    assert node is not None and not len(problems), f"{file} is a shipped trial"
    lines = file.read_text(encoding="utf-8").splitlines()
    found: dict[str, TrialSetting] = {}
    included = node.get("include")
    for name in plain(included.value) if included is not None else []:
        found |= _read(file.parent / name)
    entry = node.get("set")
    if entry is not None and isinstance(entry.value, MapNode):
        for setting in entry.value:
            comment = lines[setting.key_where.line - 1].partition(" # ")[2].strip()
            found[setting.key] = TrialSetting(plain(setting.value), comment)
    return found


def _groups(
    owner: type[Parameters], place: str, off: bool
) -> Iterator[tuple[str, type[Parameters], bool]]:
    """Yield a model and the groups in it, with their paths, and whether they are left out by default."""
    yield place, owner, off
    for name, info in owner.model_fields.items():
        group = group_of(info)
        if group is not None:
            yield from _groups(group, f"{place}.{name}".lstrip("."), off or info.default is None)


def _row(
    group: str, name: str, info: FieldInfo, settings: dict[str, TrialSetting], off: bool = False
) -> dict[str, Any]:
    default = info.get_default(call_default_factory=True)
    required = info.is_required()
    set_here = settings.get(f"{group}.{name}" if group else name)
    return {
        "group": group,
        "parameter": name,
        "text": info.description or "",
        "unit": unit_of(info),
        "default": None if required else default,
        "required": required,
        "group_is_off": off,
        "trial": None if set_here is None else set_here.value,
        "source": "" if set_here is None else set_here.source,
    }


def effect_rows(found: list[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a table: parameter, unit, default, what the trial draws, source."""
    for row in found:
        path = f"{row['group']}.{row['parameter']}" if row["group"] else row["parameter"]
        default = "no default" if row["required"] else _text(row["default"])
        set_here = "" if row["trial"] is None else _text(row["trial"])
        yield path, row["unit"], default, set_here, row["source"]


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(_text(each) for each in value)
    return "none" if value is None else str(value)
