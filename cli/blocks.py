"""``aloft blocks``: all blocks, and the contract of one; also as pages of Markdown, docs/blocks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..runtime.language.reference import BlockReference, PortReference
from .shared.options import AsJson, block_names
from .shared.output import console, errors_reported, print_json, table

if TYPE_CHECKING:
    from rich.console import Console


def blocks(
    name: Annotated[
        str, typer.Argument(help="One block, e.g. blocks.JointPD.", autocompletion=block_names)
    ] = "",
    as_json: AsJson = False,
    markdown: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Write the reference of the shipped blocks there as Markdown."
        ),
    ] = None,
) -> None:
    """List all blocks, or print the contract of one: equations, ports, units, parameters."""
    with errors_reported(as_json):
        found = [reference(name)] if name else all_references(ours=markdown is not None)
        if markdown is not None:
            from .block_pages import reference_pages

            markdown.mkdir(parents=True, exist_ok=True)
            for file, text in reference_pages(found).items():
                (markdown / file).write_text(text, encoding="utf-8")
            return
    if as_json:
        print_json(found[0].as_json() if name else {"blocks": [each.as_json() for each in found]})
    elif name:
        print_contract(console(), found[0])
    else:
        rows = [(each.name, each.machine, each.summary) for each in found]
        console().print(table("", ("block", "machine", "what it does"), rows))


def reference(name: str) -> BlockReference:
    """Return the contract of one block. Raises ``UnknownBlockError`` with the names that are alike."""
    from ..runtime.language.errors import UnknownBlockError
    from ..runtime.language.reference import block_reference
    from ..runtime.language.registry import find_block, nearest_names

    here = Path.cwd()  # where a block of the user's may lie
    try:
        return block_reference(name, find_block(name, here))
    except UnknownBlockError as error:
        similar = ", ".join(nearest_names(name, here))
        hint = f"; the nearest are {similar}" if similar else "; 'aloft blocks' lists all"
        raise UnknownBlockError(f"{error}{hint}") from error


def all_references(*, ours: bool = False) -> list[BlockReference]:
    """Return the contracts of all blocks by name; ``ours`` leaves out those of installed packages."""
    from ..runtime.language.extensions import own_extensions
    from ..runtime.language.reference import block_reference
    from ..runtime.language.registry import PACKAGES, all_blocks

    packages = (*PACKAGES, *own_extensions())

    return [
        block_reference(name, block_type)
        for name, block_type in all_blocks().items()
        if not ours or name.partition(".")[0] in packages
    ]


def print_contract(out: Console, block: BlockReference) -> None:
    """Print a block's docstring and the tables of its declarations."""
    out.print(f"[bold]{block.name}[/]  ({block.machine})\n")
    out.print(block.text, markup=False, soft_wrap=True)
    out.print("\n[bold]In a graph[/]")
    out.print(block.example, markup=False, soft_wrap=True)
    for title, ports in (
        ("Inputs", block.inputs),
        ("Outputs", block.outputs),
        ("State", block.states),
    ):
        if ports:
            out.print()
            out.print(
                table(title, ("port", "signal", "field", "type", "what it is"), port_rows(ports))
            )
    if block.parameters:
        rows = [
            (p.name, p.type, p.default or "required", p.unit, p.bounds, p.full_text)
            for p in block.parameters
        ]
        out.print()
        columns = ("parameter", "type", "default", "unit", "bounds", "what it is")
        out.print(table("Parameters", columns, rows))


def port_rows(ports: tuple[PortReference, ...]) -> list[tuple[str, str, str, str, str]]:
    """Return a row for every port with its text, and one for every field of its signal."""
    rows = []
    for port in ports:
        text = f"{port.text} ({port.note})" if port.note else port.text
        rows.append((port.name, port.signal, "", "", text))
        rows += [("", "", field.name, field.type, field.text) for field in port.fields]
    return rows
