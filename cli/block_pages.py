"""The reference of the shipped blocks as pages of Markdown: a list, and a page for each family."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..runtime.language.reference import BlockReference, PortReference


@dataclass(frozen=True)
class Family:
    """A page of the reference: its file, title, and the modules of its blocks."""

    file: str
    title: str
    modules: tuple[str, ...]


_GENERAL = "blocks.general."
FAMILIES = (
    Family("sources", "Sources and sliders", (
        f"{_GENERAL}sources", f"{_GENERAL}noise", f"{_GENERAL}slider", f"{_GENERAL}table_playback",
    )),
    Family("arithmetic", "Arithmetic, vectors and rotations", (
        f"{_GENERAL}arithmetic", f"{_GENERAL}vectors", f"{_GENERAL}wires", f"{_GENERAL}rotations",
    )),
    Family("nonlinear", "Limits, lookups and formulas", (
        f"{_GENERAL}nonlinear", f"{_GENERAL}tables", f"{_GENERAL}user_code", f"{_GENERAL}policy",
    )),
    Family("filters", "Integrators, delays, filters and PID", (
        f"{_GENERAL}integrators_and_delays", f"{_GENERAL}filters", f"{_GENERAL}linear_systems", f"{_GENERAL}pid",
    )),
    Family("logic", "Logic and states", (
        f"{_GENERAL}logic", f"{_GENERAL}state_machine", f"{_GENERAL}assertion",
    )),
    Family("estimation", "Estimators and detectors", ("blocks.estimation.",)),
    Family("control", "Controllers and safety", ("blocks.control.",)),
    Family("jumping", "Jumps and footholds", ("blocks.jumping.",)),
    Family("hopping", "Steering and hopping", ("extensions.hopping.",)),
    Family("scores", "Scores", ("blocks.scoring.",)),
    Family("robots", "Robots", ("hal.", "extensions.commissioning.")),
    Family("outside", "Other programs", ("extensions.export.", "extensions.ros2.")),
)  # fmt: skip
"""The families in the order of their list. A module that ends in a dot stands for all below it."""

NOTE = """Made from the code by `aloft blocks --markdown docs/blocks`; do not edit.
"""
HEAD = f"""# Blocks

{NOTE}
A *Mealy* block's outputs follow from its inputs in the same tick, a *Moore* block's from its state
alone. Parameters marked *live* can be changed while a graph runs: `aloft params set block.parameter=value`.
`BLOCK.PORT` stands for the output that an input reads.
"""


def reference_pages(blocks: Sequence[BlockReference]) -> dict[str, str]:
    """Write all pages.

    Args:
        blocks: the shipped blocks by name.

    Returns:
        The text of each file: ``index.md`` and one for each family.

    Raises:
        LookupError: a block belongs to no family, or to two.
    """
    members: dict[str, list[BlockReference]] = {family.file: [] for family in FAMILIES}
    for block in blocks:
        found = [f.file for f in FAMILIES if any(_lies_in(block.module, m) for m in f.modules)]
        if len(found) != 1:
            raise LookupError(
                f"{block.name} of {block.module} is in {found or 'no'} family: FAMILIES"
            )
        members[found[0]].append(block)
    listing = [HEAD]
    pages = {}
    for family in FAMILIES:
        mine = members[family.file]
        listing += [f"## [{family.title}]({family.file}.md)", ""]
        listing += [f"- [`{b.name}`]({family.file}.md#{anchor(b.name)}): {b.summary}" for b in mine]
        listing.append("")
        sections = [section(block) for block in mine]
        pages[f"{family.file}.md"] = (
            "\n".join([f"# {family.title}", "", NOTE, *sections]).rstrip() + "\n"
        )
    toctree = ["```{toctree}", ":hidden:", "", *(family.file for family in FAMILIES), "```"]
    return {"index.md": "\n".join([*listing, *toctree]) + "\n", **pages}


def _lies_in(module: str, place: str) -> bool:
    return module.startswith(place) if place.endswith(".") else module == place


def anchor(name: str) -> str:
    """Return the anchor of a heading."""
    return name.lower().replace(".", "")


def section(block: BlockReference) -> str:
    """Write a block's heading, contract, example and tables."""
    parts = [f"## {block.name}", "", f"*{block.machine}*", "", as_markdown(block.text), ""]
    parts += ["```yaml", block.example, "```", ""]
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


def as_markdown(text: str) -> str:
    """Turn a docstring into Markdown: code, and indented formulas as they stand."""
    out = []
    for paragraph in text.split("\n\n"):
        lines = paragraph.split("\n")
        set_off = next((k for k, line in enumerate(lines) if line.startswith("    ")), None)
        bulleted = lines[0].startswith("* ")
        if set_off is None or bulleted:
            out.append(_inline(paragraph))
            continue
        end = next(
            (k for k in range(set_off, len(lines)) if lines[k][:1] not in ("", " ")), len(lines)
        )
        before, formula, after = lines[:set_off], lines[set_off:end], lines[end:]
        if before:
            out.append(_inline("\n".join(before)))
        out.append("\n".join(["```text", *(line[4:] for line in formula), "```"]))
        if after:
            out.append(_inline("\n".join(after)))
    return "\n\n".join(out)


def _inline(text: str) -> str:
    """Write code with one backtick, and let no formula be read as markup."""
    pieces = re.split(r"``(.+?)``", re.sub(r"::$", ":", text), flags=re.DOTALL)
    for k in range(0, len(pieces), 2):
        pieces[k] = re.sub(r"<(?=[a-z/!])|(?<=\w)\*(?=\w)|\[(?=[^\]]*\]\()", r"\\\g<0>", pieces[k])
    pieces[1::2] = [f"`{' '.join(code.split())}`" for code in pieces[1::2]]
    return "".join(pieces)


def port_table(ports: Sequence[PortReference]) -> list[str]:
    """Write one row a port, its fields in the last column."""
    lines = ["| port | signal | what it is | fields |", "|---|---|---|---|"]
    for port in ports:
        text = f"{port.text} ({port.note})" if port.note else port.text
        fields = "; ".join(f"{field.name}: {field.type}" for field in port.fields)
        lines.append(row((f"`{port.name}`", port.signal, text, fields)))
    return lines


def row(cells: Sequence[str]) -> str:
    """Write one row of a table, with what would end a cell escaped."""
    return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
