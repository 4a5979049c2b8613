"""``aloft explain``: names what went wrong in a recorded run, from the first deviation to the fall."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ....cli.shared.options import GraphFolder, JsonBesideTables, opened_recording
from ....cli.shared.output import console, errors_reported, print_json, table

if TYPE_CHECKING:
    from ..deviations import Deviation


def explain(
    recording: Annotated[Path, typer.Argument(help="The recording of a simulated run, a .rrd.")],
    folder: GraphFolder = None,
    as_json: JsonBesideTables = False,
) -> None:
    """Say why a run failed: its deviations from truth and plan, from the first one on."""
    from ..explanation import explain as explain_run

    out = console(to_stderr=as_json)
    with errors_reported(as_json):
        found = explain_run(opened_recording(recording, folder, look=True))
    outcome = f"{'success' if found.success else 'no success'}: {found.reason}"
    if found.chain:
        out.print(
            table("What led there", ("s", "to", "phase", "kind", "deviation"), _rows(found.chain))
        )
    if found.passed:
        out.print(
            table("What passed", ("s", "to", "phase", "kind", "deviation"), _rows(found.passed))
        )
    if found.contacts:
        rows = [
            (f"{c.begin:.3f}", c.point, "false" if c.false else "missed",
             f"{1e3 * c.duration:.0f} ms", c.effect)
            for c in found.contacts
        ]  # fmt: skip
        head = ("s", "point", "contact", ">for", "what it did to the estimate")
        out.print(table("False and missed contacts", head, rows))
    if as_json:
        print_json(found.to_json())
        return
    typer.echo(outcome)
    if found.cause is not None:
        typer.echo(f"first deviation at {found.cause.begin:.3f} s: {found.cause.text}")
    elif not found.success:
        typer.echo("nothing was beyond the limits of what successful jumps show")


def _rows(deviations: Sequence[Deviation]) -> list[tuple[str, ...]]:
    return [(f"{d.begin:.3f}", f"{d.end:.3f}", d.phase, d.kind, d.text) for d in deviations]
