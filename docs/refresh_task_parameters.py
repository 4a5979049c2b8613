"""Writes the tables of a task's parameters into docs/planning.md."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from marks import refresh

from aloft.planner.task.margins import Margins
from aloft.planner.task.sequence import Hop, PhaseSpec, RoughGround
from aloft.planner.task.task import JumpTask, Knots, Weights
from aloft.runtime.language.parameters import Parameters

PAGE = Path(__file__).parent / "planning.md"
MARK = "task parameters"


def task_tables() -> str:
    """The tables of everything a task file may say, from the declarations."""
    parts = []
    for title, owner in (
        ("", JumpTask),
        ("One of `jumps`", Hop),
        ("One of `phases`", PhaseSpec),
        ("`rough`", RoughGround),
        ("`knots`", Knots),
        ("`weights`", Weights),
        ("`margins`", Margins),
    ):
        head = [f"{title}:", ""] if title else []
        rows = ["| parameter | unit | default | bounds | |", "|---|---|---|---|---|"]
        parts.append("\n".join([*head, *rows, *_rows(owner)]))
    return "\n\n".join(parts) + "\n"


def _rows(owner: type[Parameters]) -> Iterator[str]:
    for name, field in owner.model_fields.items():
        extra = field.json_schema_extra
        unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
        default = "required" if field.is_required() else _default(field.default)
        cells = (f"`{name}`", unit, default, _bounds(field.metadata), field.description or "")
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _default(value: Any) -> str:
    if value is None:
        return "-"
    if hasattr(type(value), "model_fields"):
        return "see below"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _bounds(metadata: list[Any]) -> str:
    signs = (("gt", "> "), ("ge", ">= "), ("lt", "< "), ("le", "<= "))
    found = [
        f"{sign}{getattr(item, key):g}"
        for item in metadata
        for key, sign in signs
        if getattr(item, key, None) is not None
    ]
    return ", ".join(found)


if __name__ == "__main__":
    refresh(PAGE, MARK, task_tables())
