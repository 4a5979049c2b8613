"""``aloft check``, ``aloft graph`` and ``aloft doctor``: is a graph right, which are there, can they run here."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .shared.options import AsJson, CompletedOverrides
from .shared.output import console, errors_reported, print_json, say, table

if TYPE_CHECKING:
    from ..runtime.language.stages import CheckedGraph


def check(
    graph: Annotated[Path | None, typer.Argument(help="The graph file.")] = None,
    overrides: CompletedOverrides = None,
    as_json: AsJson = False,
    cost: Annotated[
        bool, typer.Option("--cost", help="Print how large a minute of its recording is.")
    ] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of graph files, for editors.")
    ] = False,
) -> None:
    """Report every mistake in a graph at once: where, what is expected, what is found, the fix."""
    from ..runtime.language.extensions import is_own
    from ..runtime.loading import checked_file

    if schema:
        from ..runtime.loading.schema import schema_text

        typer.echo(schema_text(), nl=False)
        return
    if graph is None:
        raise typer.BadParameter("a graph file is needed, or --schema")
    with errors_reported(as_json):
        checked = checked_file(graph, overrides or [])
        users = any(not is_own(spec.block_type.__module__) for spec in checked.blocks)
        warnings = check_users_blocks(checked) if users else []
    if checked.machines:
        from ..runtime.transports.registry import open_endpoints

        warnings += open_endpoints(checked.machines)
    if sum(spec.block_type.__name__ == "Integrator" for spec in checked.blocks) > 1:
        from ..runtime.running.euler_rings import growing_rings

        warnings += growing_rings(checked)
    from ..runtime.language.recording_cost import large_recording, recording_cost

    large = large_recording(checked)
    warnings += [large] if large else []
    if as_json:
        found = {"file": str(graph), "ok": True, "count": 0, "problems": [], "warnings": warnings}
        found |= {"cost": asdict(recording_cost(checked))} if cost else {}
        print_json({"success": True, **found, "unchecked": list(checked.unchecked)})
    else:
        for text in warnings:
            typer.echo(f"warning: {text}")
        for text in checked.unchecked:
            typer.echo(f"unit not checked: {text}")
        if cost:
            typer.echo(f"cost: {recording_cost(checked)}")
        count, machines = len(checked.blocks), len(checked.machines)
        spread = f" on {machines} machine{'s' if machines > 1 else ''}" if machines else ""
        typer.echo(
            f"{graph}: no problems; {count} block{'s' if count != 1 else ''} at {checked.base_rate:g} Hz{spread}"
        )


def check_users_blocks(graph: CheckedGraph) -> list[str]:
    """Set up the users' blocks of a graph alone, which finds mistakes in their kernels and in ``setup``; return
    warnings of what ties their bits to this machine.

    Raises:
        KernelMistake: a block has one.
    """
    from ..runtime.running.block_mistakes import mistakes_of, tied_to_machine
    from ..runtime.running.kernel_checks import KernelMistake

    if mistakes := mistakes_of(graph):
        raise KernelMistake("\n".join(mistakes.values()), block=next(iter(mistakes)))
    return list(tied_to_machine(graph))


def doctor(
    as_json: AsJson = False,
) -> None:
    """Check whether all libraries load and what this machine allows a control loop in real time; print
    what to change, and change nothing."""
    from ..runtime.running.machine_check import examine_libraries, examine_machine

    findings = [examine_libraries(), *examine_machine()]
    if as_json:
        ready = all(finding.good for finding in findings)
        print_json({"ready": ready, "findings": [finding.as_json() for finding in findings]})
        return
    out = console()
    rows = [(f.name, "good" if f.good else "not yet", f.found) for f in findings]
    out.print(table("", ("what", "is", "found"), rows))
    for finding in findings:
        if finding.change:
            say(out, f"{finding.name}: {finding.change}")
