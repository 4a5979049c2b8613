"""``aloft graph``: prints a graph as it is after loading."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..runtime.language.errors import AloftError
from .shared.options import CompletedOverrides, expand_option_groups
from .shared.output import console, errors_reported, print_json, say, table
from .shared.running_graphs import As, Keys, Local

if TYPE_CHECKING:
    from rich.console import Console

    from ..logs.replay.opened_run import TickValues
    from ..runtime.language.stages import CheckedGraph


@dataclass(frozen=True)
class FormOptions:
    """The form in which a graph is printed or drawn."""

    as_table: Annotated[bool, typer.Option("--table", help="As a table (the default).")] = False
    mermaid: Annotated[bool, typer.Option("--mermaid", help="As a Mermaid diagram.")] = False
    flat: Annotated[
        bool, typer.Option("--flat", help="As one YAML file: all expanded, overrides applied.")
    ] = False
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False
    svg: Annotated[
        Path | None, typer.Option("--svg", help="As a block diagram, into this SVG file.")
    ] = None
    png: Annotated[
        Path | None, typer.Option("--png", help="As a block diagram, into this PNG file.")
    ] = None
    dark: Annotated[bool, typer.Option("--dark", help="A dark PNG file.")] = False
    web: Annotated[
        bool, typer.Option("--web", help="As a block diagram in the browser, to click on.")
    ] = False


@dataclass(frozen=True)
class LiveOptions:
    """The options that choose the running graph."""

    live: Annotated[
        bool,
        typer.Option("--live", help="Like --web, for a running graph, with its values and times."),
    ] = False
    running: Annotated[
        str, typer.Option("--run", help="With --live: the name of the run, if there are several.")
    ] = ""
    keys: Keys = None
    name: As = "viewer"
    local: Local = 0


@expand_option_groups
def graph(
    graph: Annotated[
        Path | None,
        typer.Argument(
            help="The graph file, or a recording, for its graph; without one the shipped graphs are listed."
        ),
    ] = None,
    overrides: CompletedOverrides = None,
    *,
    form: FormOptions,
    showing: LiveOptions,
    closed: Annotated[
        list[str] | None,
        typer.Option("--closed", help="A sub-graph to draw as a closed box, or 'all'."),
    ] = None,
) -> None:
    """Print the order of execution, rates, offsets, delays, and every wire with its type.

    With --svg, --png or --web, draw the blocks with their ports and wires. The page of a recording
    (RUN.rrd --web) has a slider for the time, and shows the values that a chosen block reads and writes
    then. With --live the page shows a running graph: its values, the times of its blocks, and what is late.
    Of a graph on several machines it shows all parts; --keys, --as and --local are those of `aloft top`.
    """
    from ..runtime.language.extensions import provided
    from ..runtime.loading import checked_file, picture
    from ..runtime.placement.placed import placement_json, split_over_machines

    shown = form.web or showing.live
    with errors_reported(form.as_json):
        if form.as_table + form.mermaid + form.flat + form.as_json + shown > 1:
            raise AloftError("choose one of --table, --mermaid, --flat, --json and --web")
        if showing.live:
            provided("live_page")(
                graph, showing.running, overrides or [], showing.keys, showing.name, showing.local
            )
            return
        if graph is None and not showing.running and not (form.svg or form.png or shown):
            print_shipped(as_json=form.as_json)
            return
        if graph is None or showing.running:
            raise AloftError(
                "--run NAME is for --live"
                if graph
                else "give a graph file, or --live for one that runs"
            )
        values: TickValues | None = None
        if graph.suffix == ".rrd":
            from ..logs.replay.opened_run import OpenedRun, TickValues

            opened = OpenedRun.of(graph, look=True)
            checked = opened.changed(overrides or [])
            values = TickValues(opened.file)
        else:
            checked = checked_file(graph, overrides or [])
        if form.svg or form.png:
            draw_files(checked, closed or (), form.svg, form.png, dark=form.dark)
    if form.as_json:
        placement = placement_json(split_over_machines(checked)) if checked.machines else {}
        print_json({**picture.table_json(checked), **placement})
    elif form.mermaid:
        typer.echo(picture.mermaid(checked), nl=False)
    elif form.flat:
        typer.echo(checked.text, nl=False)
    elif form.web:
        provided("diagram_page")(checked, values)
    elif form.as_table or not (form.svg or form.png):
        print_table(console(), checked)


def draw_files(
    graph: CheckedGraph, closed: Collection[str], svg: Path | None, png: Path | None, *, dark: bool
) -> None:
    """Write the block diagram into files.

    Raises:
        AloftError: there is no such sub-graph, a file cannot be written, or the extension ``studio``,
            which draws, is missing.
    """
    from ..runtime.language.extensions import provided

    try:
        if svg is not None:
            svg.write_text(provided("diagram_svg")(graph, closed), encoding="utf-8")
            typer.echo(f"diagram: {svg}", err=True)
        if png is not None:
            provided("diagram_png")(graph, png, closed, dark=dark)
            typer.echo(f"diagram: {png}", err=True)
    except OSError as error:
        raise AloftError(f"cannot write the diagram: {error}") from error


def print_shipped(*, as_json: bool) -> None:
    """Print the shipped graphs by the addresses that every verb takes: aloft run aloft:jump."""
    from ..runtime.loading.reading.files import shipped_graphs, summary

    found = [(address, str(path), summary(path)) for address, path in shipped_graphs().items()]
    if as_json:
        keys = ("graph", "file", "summary")
        print_json({"graphs": [dict(zip(keys, row, strict=True)) for row in found]})
        return
    out = console()
    out.print(table("", ("graph", "what it does"), [(row[0], row[2]) for row in found]))
    say(out, "aloft run aloft:jump runs one; aloft graph aloft:jump --flat prints it whole")


def print_table(out: Console, graph: CheckedGraph) -> None:
    """Print one row for each block, in the order of execution, with one line for each of its inputs."""
    from ..runtime.loading.picture import table as rows_of

    robot = ""
    if graph.robot is not None:
        robot = f", robot {graph.robot.name} with actuators {graph.robot.motors.profile}"
    length = "until stopped" if graph.ticks is None else f"{graph.ticks} ticks"
    say(out, f"{graph.name}: base rate {graph.base_rate:g} Hz, {length}{robot}\n")
    rows = []
    for row in rows_of(graph):
        inputs = "\n".join(item.text() for item in row.inputs)
        offset = f" + {row.offset_ticks}" if row.offset_ticks else ""
        rate = f"{row.rate_hz:g} Hz{offset}"
        machine = (
            f"{row.machine}, in the background, {row.background}" if row.background else row.machine
        )
        rows.append((str(row.order), row.path, row.use, rate, machine, inputs))
    out.print(table("", (">order", "block", "is", ">rate", "machine", "inputs"), rows))
    if graph.links.paths:
        print_ages(out, graph)
    if graph.machines:
        print_machines(out, graph)


def print_ages(out: Console, graph: CheckedGraph) -> None:
    """Print the worst age on each path for which the graph allows one."""
    from ..runtime.placement.age import worst_age

    rows = []
    for path, limit in graph.links.paths.items():
        source, _, target = (part.strip() for part in path.partition("->"))
        age = worst_age(graph, source, target)
        rows.append((path, "none" if age is None else f"{age * 1e3:g} ms", f"{limit * 1e3:g} ms"))
    out.print(table("age of the newest sample", ("path", ">at worst", ">allowed"), rows))


def print_machines(out: Console, graph: CheckedGraph) -> None:
    """Print which machine runs which blocks, and one row for each link between them."""
    from ..runtime.placement.placed import link_rows, machine_rows, split_over_machines

    placed = split_over_machines(graph)
    columns = ("machine", "endpoint", "runs", "sends", "receives")
    out.print(table("machines", columns, machine_rows(placed)))
    if placed.links:
        columns = ("source", "link", ">rate", ">payload", "is read by")
        out.print(table("links", columns, link_rows(placed)))
