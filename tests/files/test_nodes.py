"""Trees of a graph file: as plain data, with values set inside, and written again as YAML."""

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from aloft.files.nodes import (
    MapNode,
    ScalarNode,
    from_plain,
    kind,
    move,
    plain,
    text_of,
    texts_of,
)
from aloft.files.problems import Position

HERE, THERE = Position("graph.yaml", 3, 7), Position("other.yaml", 1, 2)
KEYS = st.sampled_from(["a", "b", "c"])
SCALARS = st.none() | st.booleans() | st.integers(-9, 9) | st.floats(allow_nan=False) | st.text()
DATA = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner)
)


def tree(data: dict[str, Any]) -> MapNode:
    node = from_plain(data, HERE)
    assert isinstance(node, MapNode)
    return node


@given(DATA)
def test_plain_data_comes_back_and_moves_with_its_places(data: Any) -> None:
    node = from_plain(data, HERE)
    assert plain(node) == data and node.where == HERE
    moved = move(node, THERE)
    assert plain(moved) == data and moved == from_plain(data, THERE)


@given(st.dictionaries(KEYS, DATA), st.lists(KEYS, min_size=1, max_size=4), SCALARS)
def test_a_value_is_set_inside_and_all_else_stays(
    data: dict[str, Any], path: list[str], value: Any
) -> None:
    expected = copy.deepcopy(data)
    inner = expected
    for key in path[:-1]:
        old = inner.get(key)
        if isinstance(old, str) and old.endswith((".yaml", ".yml")):
            old = {"file": old}
        inner[key] = old if isinstance(old, dict) else {}
        inner = inner[key]
    inner[path[-1]] = value
    node = tree(data)
    changed = node.assign(path, ScalarNode(value, THERE), THERE)
    assert plain(changed) == expected
    assert list(changed.keys()) == list(expected)
    assert plain(node) == data, "the tree itself is not changed"
    entry = changed.get(path[0])
    assert entry is not None and entry.key_where == THERE
    assert changed.get("nowhere") is None


def test_a_value_set_inside_of_a_named_file_changes_what_is_in_it() -> None:
    node = tree({"task": "tasks/hop.yaml"}).assign(["task", "rise"], ScalarNode(0.1, HERE), HERE)
    assert plain(node) == {"task": {"file": "tasks/hop.yaml", "rise": 0.1}}


def test_texts_are_those_of_values_in_their_order() -> None:
    node = tree({"a": "one", "b": [1, "two", {"c": "three"}], "d": None})
    assert list(texts_of(node)) == ["one", "two", "three"]


@given(DATA)
def test_what_is_written_in_one_line_reads_back(data: Any) -> None:
    text = text_of(data)
    assert "\n" not in text
    found = yaml.safe_load(text) if data != "" else ""
    if not any("\ud800" <= c < "\ue000" or c in "\ufffe\uffff" for c in str(data)):
        assert found == data or math.isinf(0.0 if not isinstance(data, float) else data)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (math.nan, ".nan"), (math.inf, ".inf"), (-math.inf, "-.inf"), (1e-5, "1.0e-05"),
        (1.5e-7, "1.5e-07"), (True, "true"), (None, "null"), ("yes", '"yes"'), ("4 s", "4 s"),
        ("a: b", '"a: b"'), (["a", 1.0], "[a, 1.0]"), ({"k": [1]}, "{k: [1]}"),
        ("\x01\x7f\x9f\u2028", '"\\u0001\\u007f\\u009f\\u2028"'), ("é ", '"é "'),
    ],
)  # fmt: skip
def test_how_values_are_written(value: Any, text: str) -> None:
    assert text_of(value) == text


def test_arrays_are_lists_and_anything_else_its_text() -> None:
    assert plain(from_plain(np.array([[1.0, 2.0]]), HERE)) == [[1.0, 2.0]]
    assert plain(from_plain(np.float64(0.5), HERE)) == 0.5
    assert plain(from_plain(Path("a/b"), HERE)) == "a/b"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({}, "a mapping"), ([], "a list"), (None, "nothing"), (True, "true (true or false)"),
        ("x", "the text 'x'"), (1.5, "the number 1.5"),
    ],
)  # fmt: skip
def test_values_in_words(value: Any, words: str) -> None:
    assert kind(from_plain(value, HERE)) == words
