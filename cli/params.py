"""``aloft params``: look at and change the parameters of a graph that is running."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.language.errors import AloftError
from .shared.options import AsJson
from .shared.output import console, errors_reported, print_json, table

params = typer.Typer(
    name="params",
    help="List, get or set the parameters of a running graph, at a tick boundary; or in a browser.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Run = Annotated[
    str, typer.Option("--run", help="The name of the run; needed only if there are several.")
]


@params.command("list")
def list_parameters(
    run: Run = "",
    everything: Annotated[
        bool,
        typer.Option("--all", help="Also parameters that cannot be changed while the graph runs."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List the parameters that can be changed while the graph runs."""
    with errors_reported(as_json):
        graph, found = ask_list(run)
    shown = [entry for entry in found if entry["live"] or everything]
    if as_json:
        print_json({"success": True, "graph": graph, "parameters": shown})
        return
    rows = [
        (entry["path"], text_of(entry["value"]), entry["unit"], "yes" if entry["live"] else "no",
         entry["text"])
        for entry in shown
    ]  # fmt: skip
    columns = ("parameter", "value", "unit", "live", "what it is")
    console().print(table(f"{graph}: parameters", columns, rows))


@params.command("get")
def get(
    names: Annotated[list[str], typer.Argument(help="Parameters, e.g. landing.w_l.")],
    run: Run = "",
    as_json: AsJson = False,
) -> None:
    """Print the present values of parameters."""
    with errors_reported(as_json):
        _, found = ask_list(run)
        values = {name: value_of(name, found) for name in names}
    if as_json:
        print_json({"success": True, "values": values})
        return
    for name, value in values.items():
        typer.echo(f"{name}: {text_of(value)}" if len(names) > 1 else text_of(value))


@params.command("set")
def set_(
    settings: Annotated[list[str], typer.Argument(help="block.parameter=value, one or more.")],
    run: Run = "",
    as_json: AsJson = False,
) -> None:
    """Change parameters, all in the same tick. If one of them is wrong, none is changed."""
    from ..runtime.live.parameter_endpoint import set_parameters
    from .shared.running_graphs import find

    with errors_reported(as_json):
        changes = set_parameters(find(run), settings)
    if as_json:
        print_json({"success": True, "changes": changes})
        return
    for change in changes:
        old, new = text_of(change["old"]), text_of(change["new"])
        typer.echo(f"tick {change['tick']}: {change['path']} {old} -> {new}")


@params.command("web")
def web(
    run: Run = "",
    save: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Where the page writes changed values; by default GRAPH-tuned.yaml."
        ),
    ] = None,
) -> None:
    """Change them in the browser, with sliders, beside the running graph's diagram."""
    from ..runtime.language.extensions import provided

    with errors_reported(False):
        provided("live_page")(None, run, save=save, opened="parameters")


def ask_list(run: str) -> tuple[str, list[dict[str, Any]]]:
    """Ask for the graph's name and all its parameters. Raises ``AloftError``."""
    from ..runtime.live.parameter_endpoint import ask
    from .shared.running_graphs import find

    answer = ask(find(run), {"verb": "list"})
    return answer["graph"], answer["parameters"]


def value_of(name: str, found: list[dict[str, Any]]) -> Any:
    """Return the value of ``block.parameter``, or of something inside it. Raises ``AloftError``."""
    for entry in found:
        if name == entry["path"]:
            return entry["value"]
        inside = entry["value"]
        if name.startswith(f"{entry['path']}."):
            for step in name.removeprefix(f"{entry['path']}.").split("."):
                inside = inside.get(step) if isinstance(inside, dict) else None
            if inside is not None:
                return inside
    near = get_close_matches(name, [entry["path"] for entry in found], 1, 0.0)
    raise AloftError(f"there is no parameter {name!r}; the nearest is {', '.join(near)}")


def text_of(value: Any) -> str:
    """Write a value as in a graph file."""
    from ..files.nodes import text_of

    return text_of(value)
