"""``aloft branch``: lets a recorded run go on from one instant with other parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import GraphFolder, JsonBesideTables, Trust, opened_recording
from ....cli.shared.output import (
    SET_HELP,
    console,
    errors_reported,
    number,
    print_json,
    say,
    table,
)
from ....cli.shared.replayed import as_data, print_differences, write_runs

if TYPE_CHECKING:
    from rich.console import Console

    from ....logs.replay.opened_run import OpenedRun
    from ....logs.replay.replay import Replayed


def branch(
    recording: Annotated[Path, typer.Argument(help="The recording of a simulated run, a .rrd.")],
    at: Annotated[float, typer.Option(help="When it leaves the recorded run [s].")],
    overrides: Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)] = None,
    until: Annotated[
        float | None, typer.Option(help="When it ends [s]; by default as the graph says.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--out", "-o", help="Both runs side by side, a .rrd file.")
    ] = None,
    folder: GraphFolder = None,
    trust: Trust = False,
    as_json: JsonBesideTables = False,
) -> None:
    """Resume a recorded run from any time with different parameters, and compare."""
    from ..branching import branch as branch_run

    out = console(to_stderr=as_json)
    with errors_reported(as_json):
        opened = opened_recording(recording, folder, trust=trust)
        rate = opened.file.header.base_rate
        graph = opened.changed(overrides) if overrides else opened.graph
        end = None if until is None else round(until * rate)
        done = branch_run(opened, round(at * rate), graph, until=end)
        path = output or recording.with_name(f"{recording.stem}-branch.rrd")
        written = write_runs(path, opened, done)
    first = done.first
    verdict = (
        f"as recorded, every byte of {done.signals.compared} ticks" if first is None
        else f"leaves the recorded run at {first}"
    )  # fmt: skip
    print_differences(out, done)
    print_outcomes(out, opened, done)
    say(out, f"recorded and branched side by side: {written}")
    if as_json:
        outcome = opened.file.outcome or {}
        print_json(
            as_data(recording, done, verdict, [], list(opened.restored.said), written)
            | {"success": True, "metrics": dict(done.result.metrics), "outcome": verdict_of(done)}
            | {"recorded_metrics": outcome.get("metrics", {}), "at_tick": done.first_tick}
        )
    else:
        typer.echo(verdict)


def verdict_of(done: Replayed) -> dict[str, Any]:
    """Return the branch's outcome as plain data."""
    return {"success": done.result.success, "reason": done.result.reason}


def print_outcomes(out: Console, opened: OpenedRun, done: Replayed) -> None:
    """Print the outcomes of both runs, and the metrics that differ."""
    before = opened.file.outcome or {}
    metrics = before.get("metrics", {})
    rows = [("end", str(before.get("reason", "")), done.result.reason)]
    rows += [
        (name, number(metrics.get(name, "")), number(value))
        for name, value in done.result.metrics.items()
        if metrics.get(name) != value
    ]
    out.print(table("", ("", ">recorded", ">branch"), rows))
