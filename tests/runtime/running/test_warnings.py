"""Warnings: what a block wants the readers of its results to know."""

from __future__ import annotations

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.running.executor import run
from aloft.runtime.running.sink import Note, Sink
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Waiver(Block):
    """Has something to say."""

    y = Output(Vector, text="nothing")

    @classmethod
    def dimensions(cls, params: object, robot: object) -> dict[str, int]:
        return {"n": 1}

    def step(self) -> None: ...

    def warnings(self) -> list[str]:
        return ["the check was waived"]


class Listener(Sink):
    """Keeps the notes."""

    def __init__(self) -> None:
        self.notes: list[Note] = []

    def note(self, note: Note) -> None:
        self.notes.append(note)


def test_a_warning_is_in_the_result_and_told_to_the_sinks() -> None:
    listener = Listener()
    result = run(checked_graph({"b0": BlockUse(Waiver, {})}, ticks=3), sinks=[listener])
    assert result.success
    assert result.block_warnings == ("b0: the check was waived",)
    assert result.to_json()["block_warnings"] == ["b0: the check was waived"]
    (note,) = (note for note in listener.notes if note.kind == "warning")
    assert (note.tick, note.level, note.text) == (0, "WARN", "b0: the check was waived")


class Finder(Waiver):
    """Finds something out while it runs."""

    def warnings(self) -> list[str]:
        found = ["it ran"] if self.tick else []
        return [*super().warnings(), *found]


def test_what_a_block_has_found_out_in_the_run_is_added_once() -> None:
    result = run(checked_graph({"b0": BlockUse(Finder, {})}, ticks=3))
    assert result.block_warnings == ("b0: the check was waived", "b0: it ran")
