"""Writes the tables of a task's parameters into docs/planning.md."""

from __future__ import annotations

from pathlib import Path

from aloft.cli.task_page import BEGIN, END, task_tables

PAGE = Path(__file__).parent / "planning.md"

if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    PAGE.write_text(
        f"{before}{BEGIN}{task_tables()}{END}{rest.partition(END)[2]}", encoding="utf-8"
    )
