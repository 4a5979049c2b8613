"""The reference of blocks as a Markdown page, for docs/blocks.md."""

from __future__ import annotations

from collections.abc import Sequence

from ...runtime.language.reference import BlockReference, PortReference

HEAD = """# Blocks

Made from the code by `aloft blocks --markdown > docs/blocks.md`; do not edit. A *Mealy* block's
outputs follow from its inputs in the same tick, a *Moore* block's from its state alone. Parameters
marked *live* can be changed while a graph runs: `aloft params set block.parameter=value`.
"""


def reference_page(blocks: Sequence[BlockReference]) -> str:
    """The whole page: a list of all blocks, then a section for each."""
    listing = [f"- [`{b.name}`](#{anchor(b.name)}): {b.summary}" for b in blocks]
    sections = [section(block) for block in blocks]
    return "\n".join([HEAD, *listing, "", *sections]).rstrip() + "\n"


def anchor(name: str) -> str:
    """The anchor that a heading of that name gets."""
    return name.lower().replace(".", "")


def section(block: BlockReference) -> str:
    """A block's heading, docstring and tables."""
    parts = [f"## {block.name}", "", f"*{block.machine}*", "", "```text", block.text, "```", ""]
    for title, ports in (
        ("Inputs", block.inputs),
        ("Outputs", block.outputs),
        ("State", block.states),
    ):
        if ports:
            parts += [f"**{title}**", "", *port_table(ports), ""]
    if block.parameters:
        parts += ["**Parameters**", "", "| name | type | default | unit | bounds | what it is |"]
        parts += ["|---|---|---|---|---|---|"]
        for p in block.parameters:
            cells = (f"`{p.name}`", p.type, p.default or "required", p.unit, p.bounds, p.full_text)
            parts.append(row(cells))
        parts.append("")
    return "\n".join(parts)


def port_table(ports: Sequence[PortReference]) -> list[str]:
    """One row a port, its fields in the last column."""
    lines = ["| port | signal | what it is | fields |", "|---|---|---|---|"]
    for port in ports:
        text = f"{port.text} ({port.note})" if port.note else port.text
        fields = "; ".join(f"{field.name}: {field.type}" for field in port.fields)
        lines.append(row((f"`{port.name}`", port.signal, text, fields)))
    return lines


def row(cells: Sequence[str]) -> str:
    """One row of a table, with what would end a cell escaped."""
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
