"""``aloft export``: a graph in a form that other tools run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ....cli.shared.options import AsJson, Overrides
from ....cli.shared.output import console, errors_reported, print_json, say, table
from ....runtime.language.errors import ExitCode

if TYPE_CHECKING:
    from ..clib.check import Checked

export = typer.Typer(
    name="export",
    help="Write a graph, or a part of it, for other tools: as a library of C or a Functional Mock-up Unit.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
GraphPart = Annotated[
    str, typer.Argument(help="The graph file, and behind a colon the sub-graph or block.")
]
Outputs = Annotated[
    list[str] | None,
    typer.Option("--output", help="An output, as block.port, in place of all. Repeatable."),
]

Delays = Annotated[
    str,
    typer.Option(
        "--delays",
        help="Where delays of wires into the part are: inside (the caller gives the newest values) or outside.",
    ),
]


@export.command("fmu")
def fmu(
    graph: GraphPart,
    to: Annotated[
        Path, typer.Option("--out", "-o", help="The file to write, such as controller.fmu.")
    ],
    fmi: Annotated[str, typer.Option("--fmi", help="The version of FMI, 3.0 or 2.0.")] = "3.0",
    output: Outputs = None,
    delays: Delays = "inside",
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Export a graph or a sub-graph as a Functional Mock-up Unit (co-simulation).

    What the sub-graph reads from outside becomes its inputs, what it declares as outputs its
    outputs. Of a whole graph the inputs are its blocks blocks.External and the sensors of its robot, and
    the outputs what the robot reads or, without a robot, what no block reads. The FMU is a
    library of C. Where a block needs Python, it is named, and aloft has to be installed in the Python that
    runs the FMU.
    """
    with errors_reported(as_json):
        from ..fmi.exporting.write import export as write

        path, part = _parts(graph)
        made = write(path, to, part, set_ or [], output or [], fmi, delays)
        terminals = [("input", t) for t in made.inputs] + [("output", t) for t in made.outputs]
        if as_json:
            print_json(
                {
                    "file": str(made.file),
                    "period_s": made.period,
                    "inputs": [t.plain() for t in made.inputs],
                    "outputs": [t.plain() for t in made.outputs],
                    "problems": made.problems,
                    "python": made.python,
                    "input_delays": [each.plain() for each in made.delays],
                }
            )
            return
        out = console()
        rows = [
            (kind, t.name, str(list(t.shape)), t.unit if t.unit is not None else "not checked")
            for kind, t in terminals
        ]
        out.print(table("", ["", "variable", "shape", "unit"], rows))
        for delay in made.delays:
            say(out, f"{', '.join(delay.sources)}: {delay}")
        say(out, f"{made.file}: FMI {fmi}, co-simulation, steps of {made.period:.6g} s")
        if made.python:
            say(out, "it needs Python with aloft where it runs:")
        for reason in made.python:
            say(out, f"  {reason}")
        for problem in made.problems or ():
            say(out, f"FMPy's validator: {problem}")
        if made.problems == ():
            say(out, "FMPy's validator found no problem")


@export.command("c")
def c(
    graph: GraphPart,
    to: Annotated[
        Path, typer.Option("--out", "-o", help="The folder to write; its name is the library's.")
    ],
    target: Annotated[
        str, typer.Option("--target", help="The processor: x86_64, aarch64 or wasm.")
    ] = "x86_64",
    check: Annotated[
        Path | None,
        typer.Option("--check", help="A recording of the graph, of which every byte is compared."),
    ] = None,
    output: Outputs = None,
    delays: Delays = "inside",
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Export a graph or a sub-graph as a library of C: no Python, no allocation, the same bytes.

    Of a whole graph the robot stays outside: what it reads are the outputs. --check runs every tick
    of a recording through the library, for other processors in an emulator or in Node. The exit code is
    1 where a byte differs.
    """
    with errors_reported(as_json):
        from ..clib.check import check as compare
        from ..clib.input_delays import InputDelay
        from ..clib.write import write_library

        path, part = _parts(graph)
        made = write_library(path, to, part, set_ or [], output or [], target, delays)
        found = compare(made.description, check) if check is not None else None
        if as_json:
            result = {**made.about, "check": None if found is None else asdict(found)}
            print_json({"folder": str(to), **result})
        else:
            out = console()
            about = made.about
            rows = [(name, f"{each['bytes']} bytes") for name, each in about["files"].items()]
            rows += [
                (text, f"{about[f'{key}_bytes']} bytes")
                for key, text in (
                    ("memory", "an instance"), ("constant", "constants"), ("state", "a saved state"),
                )
            ]  # fmt: skip
            out.print(table("", ["", "size"], rows))
            for each in about["input_delays"]:
                say(out, f"{', '.join(each['sources'])}: {InputDelay(**each)}")
            say(out, f"{to}: {len(about['blocks'])} blocks for {target}")
            if found is not None:
                say(out, _verdict(found))
        if found is not None and found.difference:
            raise typer.Exit(int(ExitCode.NOT_SUCCESSFUL))


def _verdict(found: Checked) -> str:
    """Describe the result of a check in one sentence."""
    if found.difference:
        return f"the bytes differ from the recording: {found.difference}"
    seen = ", ".join(f"{name} in {count} ticks" for name, count in found.statuses.items())
    return (
        f"{found.ticks} ticks: all {found.signal_bytes} bytes of signals and {found.state_bytes} bytes of "
        f"state are as recorded{f'; {seen}' if seen else ''}"
        f"{'' if found.step_s is None else f'; a tick takes {1e6 * found.step_s:.3g} us'}"
    )


def _parts(graph: str) -> tuple[str, str]:
    """Split the address into the graph's file and the path of the part behind it."""
    shipped = "aloft:" if graph.startswith("aloft:") else ""
    path, _, part = graph.removeprefix(shipped).partition(":")
    return f"{shipped}{path}", part
