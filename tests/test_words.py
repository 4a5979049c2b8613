"""A word has one meaning in the names of classes, and names that misled do not come back."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

SCRIPT = Path(__file__).parent.parent / "lab" / "count_words.py"
TEXT = """
class PlacedPart:
    def patience(self, said): ...

class RepartitionPlanner: ...

class JumpPlan: ...
"""


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("script_count_words", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # named tuples look their module up
    spec.loader.exec_module(module)
    return module


COUNT = script()


def test_what_is_counted() -> None:
    names = COUNT.defined("planner/a.py", TEXT)
    assert [COUNT.where(name) for name in COUNT.misleading(names)] == ["planner/a.py:3: patience"]
    assert not [*COUNT.misleading(COUNT.defined("hal/a.py", TEXT))]
    counted = {word: [n.name for n in COUNT.second_meanings(word, names)] for word in COUNT.WORDS}
    assert {word for word, found in counted.items() if found == ["PlacedPart"]} == {"part", "place"}
    assert sum(map(len, counted.values())) == 2


def test_a_name_may_mislead_in_one_function_only() -> None:
    text = "def report(): printed_problems = 1\ndef printed(): printed_problems = 2\n"
    found = [*COUNT.misleading(COUNT.defined("files/problems.py", text))]
    assert [name.line for name in found] == [1]


@pytest.fixture(scope="module")
def names() -> list[Any]:
    """All that the files define; to read them takes a second."""
    return [name for path, text in COUNT.tracked().items() for name in COUNT.defined(path, text)]


def test_no_name_is_ambiguous(names: list[Any]) -> None:
    found = [*COUNT.misleading(names)]
    found += [name for word in COUNT.WORDS for name in COUNT.second_meanings(word, names)]
    assert [COUNT.where(name) for name in found] == []
    assert not set(COUNT.tracked()) & set(COUNT.MISLEADING_FILES)


def test_every_class_of_a_word_is_there(names: list[Any]) -> None:
    listed = {name for word in COUNT.WORDS.values() for name in word.classes.split()}
    assert sorted(listed - {name.name for name in names}) == []
