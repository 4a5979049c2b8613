"""Panels of recorded signals, of one run or of several over each other, for plots and beside films."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ...runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ...logs.file.reader import RecordedRun
    from ...plotting import Panel


def run_panels(
    runs: Sequence[RecordedRun],
    names: Sequence[str],
    signals: Sequence[str],
    start: float | None,
    end: float | None,
) -> list[Panel]:
    """Make one panel for every field that ``signals`` say, from ``start`` to ``end`` [s], with the lines
    of all runs, which are called ``names``.

    Raises:
        AloftError: there is no such signal or element, nothing was recorded in that time, or the runs
            have other fields of that name.
    """
    return [
        panel
        for signal in signals
        for panel in _overlaid([_panels_of(run, signal, start, end) for run in runs], names)
    ]


def _panels_of(run: RecordedRun, name: str, start: float | None, end: float | None) -> list[Panel]:
    """Make one panel for every field that ``name`` says.

    Raises:
        AloftError: there is no such signal or element, or nothing was recorded in that time.
    """
    from ...logs.viewing.signal_names import element_names, unit_of
    from ...runtime.running import plots

    known, robot = run.signals(), run.header.robot

    def legend(each: str, shape: tuple[int, ...]) -> plots.Legend:
        field = known[each]
        named = robot.element_names if robot else {}
        rows = named.get(str(field.dimensions[0]), ()) if field.dimensions else ()
        return plots.Legend(unit_of(field), element_names(field, robot), rows, field.values)

    try:
        return plots.panels_of(run, run.__getitem__, legend, name, start, end)
    except (KeyError, ValueError) as error:
        raise AloftError(str(error.args[0])) from error


def _overlaid(runs: Sequence[Sequence[Panel]], names: Sequence[str]) -> list[Panel]:
    """Return one panel a field with the lines of all runs, which have their run's name before their own.

    Raises:
        AloftError: the runs have other fields of that name.
    """
    if len(runs) == 1:
        return list(runs[0])
    if len({len(panels) for panels in runs}) > 1:
        raise AloftError("the recordings have different fields of that name; name one field")
    return [
        replace(
            same[0],
            lines=[
                replace(line, name=f"{name} {line.name}".rstrip())
                for name, panel in zip(names, same, strict=True)
                for line in panel.lines
            ],
        )
        for same in zip(*runs, strict=True)
    ]
