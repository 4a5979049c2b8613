"""Parameters that another block tells: the value in the flattened graph, and every wrong reference."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import pytest

from aloft.runtime.language.block import Block, Context, Output, UnmetRequirement
from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.loading import LoadError, checked_file, checked_text

PATH = Path(__file__).parent / "graph.yaml"


class Level(Signal):
    value = Field(unit="m", text="a height")


class Teller(Block):
    """Tells twice its height, nothing of a negative one, and breaks at 99."""

    class Params(Parameters):
        height: float = parameter(1.0, unit="m", text="a height")
        count: int = parameter(2, text="a number")

    params: Params
    asked: ClassVar[dict[str, frozenset[str]]] = {}
    y = Output(Level, text="the height")

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        assert isinstance(params, cls.Params)
        cls.asked[context.path] = context.asked
        if params.height == 99.0:
            raise AloftError("99 is too much")
        low = UnmetRequirement("nothing is below the ground", fix="height: 1 m")
        return {"twice": 2.0 * params.height if params.height >= 0.0 else low}

    def step(self) -> None:
        self.y.value[()] = self.params.height


HERE = f"{Path(__file__).stem}:Teller"


def graph(first: str, second: str, more: Mapping[str, Any] | None = None) -> Any:
    text = f"rate: 10 Hz\nblocks:\n  a: {{use: '{HERE}', with: {first}}}\n  b: {{use: '{HERE}', with: {second}}}\n"
    return checked_text(text, PATH, more or {})


def problems(first: str, second: str) -> list[str]:
    with pytest.raises(LoadError) as caught:
        graph(first, second)
    return [
        f"{p.where.line}: {p.code}: {p.message} -> {p.fix}" for p in caught.value.report.problems
    ]


@pytest.mark.parametrize(
    ("first", "second", "height"),
    [
        ("{height: 3 m}", "{height: {from: a.twice}}", 6.0),
        ("{height: 3 m}", "{height: {from: a.height}}", 3.0),
        ("{height: 30 cm}", "{height: {from: a.twice}}", 0.6),
        ("{}", "{height: {from: a.height}}", 1.0),
    ],
)
def test_the_value_takes_the_place_of_the_reference(first: str, second: str, height: float) -> None:
    checked = graph(first, second)
    assert checked.block("b").params.height == height
    assert f"height: {height}" in checked.text
    assert "from:" not in checked.text


def test_references_may_follow_one_another_in_any_order() -> None:
    checked = graph("{height: {from: b.twice}}", "{height: 2}")
    assert checked.block("a").params.height == 4.0


def test_who_sets_the_parameter_replaces_the_reference() -> None:
    checked = graph("{}", "{height: {from: a.twice}}", {"b.height": 7})
    assert checked.block("b").params.height == 7.0


def test_a_change_of_the_teller_changes_the_told() -> None:
    checked = graph("{}", "{height: {from: a.twice}}", {"a.height": 5})
    assert checked.block("b").params.height == 10.0


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("{}", "{height: {from: c.twice}}", "4: unknown-parameter: b.height: there is no block 'c'"),
        ("{}", "{height: {from: a.twise}}",
         f"a ({HERE}) tells no 'twise' -> {{from: a.twice}}"),
        ("{}", "{height: {from: twice}}", "there is no block ''"),
        ("{height: -1}", "{height: {from: a.twice}}",
         "4: unmet-requirement: b.height cannot follow from a.twice: nothing is below the ground -> height: 1 m"),
        ("{height: {from: b.twice}}", "{height: {from: a.twice}}",
         "loop: the parameters of a -> b -> a follow from each other"),
        ("{height: {from: a.twice}}", "{}", "the parameters of a -> a follow from each other"),
        ("{height: 99}", "{height: {from: a.twice}}",
         "cannot tell what follows from its parameters: AloftError: 99 is too much"),
        ("{}", "{count: {from: a.height}}", "b.count cannot be 1.5"),
        ("{}", "{height: {from: a.height, delay: 1}}", "b.height cannot be"),
    ],
)  # fmt: skip
def test_what_leads_nowhere_is_reported_once(first: str, second: str, words: str) -> None:
    if "1.5" in words:
        first = "{height: 1.5}"
    found = problems(first, second)
    assert len(found) == 1
    assert words in found[0]


def test_a_broken_teller_is_the_only_problem() -> None:
    assert problems("{height: many}", "{height: {from: a.twice}}")[0].startswith("3: bad-parameter")
    assert len(problems("{height: many}", "{height: {from: a.twice}}")) == 1


def test_a_value_set_inside_a_named_file_changes_what_is_in_it(tmp_path: Path) -> None:
    checked = checked_file(
        "graphs/jump.yaml", ["plan.task=tasks/in_situ.yaml", "plan.task.distance_x=20 cm"]
    )
    task = checked.block("plan").params.model_dump()["task"]
    assert task == {"file": "tasks/in_situ.yaml", "distance_x": "20 cm"}
    assert checked.block("score").params.model_dump()["distance"] == [0.2, 0.0]


def test_a_block_is_told_which_of_its_values_are_asked_for() -> None:
    found = graph("{height: 2.0}", "{height: {from: a.twice}, count: {from: a.count}}")
    asked = found.block("a").block_type.asked
    assert asked["a"] == {"twice", "count"}
    asked.clear()
    graph("{height: 2.0}", "{height: 3.0}")
    assert not asked
