"""``aloft keys``: makes certificates, and each machine's session with the least access it needs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ....cli.shared.options import AsJson, Overrides
from ....cli.shared.output import console, errors_reported, print_json, say, table


def keys(
    graph: Annotated[Path, typer.Argument(help="The graph file, whose endpoints are tls/...")],
    output: Annotated[
        Path, typer.Option("--out", "-o", help="The folder to write, or to complete.")
    ] = Path("keys"),
    observer: Annotated[
        list[str] | None,
        typer.Option(help="A name that may watch and never command. Repeatable."),
    ] = None,
    days: Annotated[int, typer.Option(min=2, help="How long certificates are valid.")] = 365,
    anew: Annotated[
        bool,
        typer.Option("--anew", help="Make another authority: earlier certificates are worthless."),
    ] = False,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Make the certificates and sessions of all machines of a graph: mutual TLS, least access."""
    from ....runtime.loading import checked_file
    from ....runtime.placement.placed import split_over_machines
    from ....runtime.transports.zenoh_session import keys_from
    from ..keys import make_keys

    with errors_reported(as_json):
        placed = split_over_machines(checked_file(graph, overrides or []))
        observers = list(observer or [])
        made = make_keys(placed, output, observers, days=days, anew=anew)
    machines = [spec.name for spec in placed.machines]
    sends = {
        name: [key for other in machines if other != name for key in keys_from(placed, name, other)]
        for name in machines
    }
    if as_json:
        about = {"folder": str(output), "made": made, "machines": sends, "observers": observers}
        print_json({"success": True, **about})
        return
    out = console()
    rows = [
        (name, "made" if name in made else "kept", f"{len(sends[name])} keys" if name in sends
         else "nothing", "its links" if name in sends else "watch/**", str(output / name))
        for name in (*machines, *observers)
    ]  # fmt: skip
    out.print(table("", ("name", "certificate", "may send", "may hear", "folder"), rows))
    say(out, f"Copy to each machine its own folder, and nothing else of {output}. Then: "
        f"aloft run {graph} --machine NAME --keys {output}")  # fmt: skip
