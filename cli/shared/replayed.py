"""Outcome of a replay: the table of differences, plain data, and the file with both runs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...runtime.language.errors import AloftError
from .output import number, table

if TYPE_CHECKING:
    from rich.console import Console

    from ...logs.replay.opened_run import OpenedRun
    from ...logs.replay.replay import Replayed

MOST_ROWS = 15


def write_runs(output: Path, opened: OpenedRun, done: Replayed) -> Path:
    """Write both runs to a file. Raises ``AloftError``."""
    from ...logs.replay.replay_recording import write_replay

    try:
        return write_replay(output, opened, done)
    except OSError as error:
        raise AloftError(f"{output} cannot be written ({error.strerror or error})") from error


def print_differences(out: Console, done: Replayed) -> None:
    """Print the fields that differ, those with the largest difference first."""
    units = _units(done)
    rows = []
    for name, each in done.signals.largest()[:MOST_ROWS]:
        ulps = "" if each.first.ulps is None else f"{each.ulps:.3g}"
        rows.append(
            (name, number(each.largest), units.get(name, ""), str(each.largest_tick),
             ulps, str(each.first.tick), str(each.ticks), str(each.elements))
        )  # fmt: skip
    if rows:
        more = len(done.signals.fields) - len(rows)
        title = "differences" + (f" (the largest; {more} more fields differ)" if more > 0 else "")
        columns = ("field", ">largest", "unit", ">at tick", ">most ULP", ">first tick",
                   ">ticks", ">elements")  # fmt: skip
        out.print(table(title, columns, rows))


def _units(done: Replayed) -> dict[str, str]:
    """Return the unit of every field, by name."""
    return {
        f"{spec.path}.{port}.{name}": "" if field.unit is None else str(field.unit)
        for spec in done.bound.graph.blocks
        for port, declared in spec.block_type.outputs.items()
        for name, field in declared.signal.fields.items()
    }


def as_data(
    recording: Path,
    done: Replayed,
    verdict: str,
    other: list[str],
    restored: list[str],
    written: Path | None,
) -> dict[str, Any]:
    """Return the whole result as plain data."""
    first = done.first
    return {
        "success": done.identical,
        "reason": verdict,
        "recording": str(recording),
        "first_tick": done.first_tick,
        "ticks": done.signals.compared,
        "keyframes": done.states.compared,
        "ran": list(done.ran),
        "first_difference": None
        if first is None
        else {**asdict(first), "block": first.block, "place": first.place},
        "differing_elements": done.signals.elements,
        "fields": {
            name: {
                "largest": each.largest,
                "largest_tick": each.largest_tick,
                "ulps": each.ulps,
                "first_tick": each.first.tick,
                "ticks": each.ticks,
                "elements": each.elements,
            }
            for name, each in done.signals.largest()
        },
        "notes": list(done.notes),
        "other_since": other,
        "restored": restored,
        "outcome": {"success": done.result.success, "reason": done.result.reason},
        "output": None if written is None else str(written),
    }
