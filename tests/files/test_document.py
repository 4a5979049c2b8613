"""YAML as people mean it, with the place of every value, and its mistakes as problems."""

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.files.document import read_file, read_mapping, read_value
from aloft.files.nodes import MapNode, ScalarNode, plain, text_of
from aloft.files.problems import Position, Problems
from aloft.runtime.loading import check


def read(text: str) -> Any:
    problems = Problems()
    node = read_value(text, "file.yaml", problems)
    assert problems.report("file.yaml").problems == ()
    assert node is not None
    return plain(node)


def messages(text: str) -> list[str]:
    problems = Problems()
    read_value(text, "f", problems)
    return [f"{p.where}: {p.message}" for p in problems.report("f").problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 0.001),
        ("1E5", 1e5),
        ("-2.5e+2", -250.0),
        (".5", 0.5),
        ("3.", 3.0),
        ("-.inf", -math.inf),
        ("010", 10),
        ("0x1F", 31),
        ("1_000", 1000),
        ("-7", -7),
        ("on", "on"),
        ("off", "off"),
        ("yes", "yes"),
        ("no", "no"),
        ("y", "y"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("12:30", "12:30"),
        ("2026-11-21", "2026-11-21"),
        ("'1e-3'", "1e-3"),
        ("!!str 5", "5"),
        ("!!float 5", 5.0),
        ("500 Hz", "500 Hz"),
        ("1.2.3", "1.2.3"),
        ("_", "_"),
        ("-", None),
    ],
)
def test_scalars(text: str, value: object) -> None:
    found = read(f"key: {text}" if text != "-" else "key:")["key"]
    assert found == value
    assert type(found) is type(value)


def test_keys_are_the_text_that_is_written() -> None:
    assert list(read("{on: 1, 2: 3, null: 4, true: 5}")) == ["on", "2", "null", "true"]


def test_every_key_and_value_knows_its_place() -> None:
    problems = Problems()
    node = read_value("a:\n  bc: [10, {d: e}]\n", "f", problems)
    assert isinstance(node, MapNode)
    inner = node.entries[0].value
    assert isinstance(inner, MapNode)
    entry = inner.entries[0]
    assert entry.key_where == Position("f", 2, 3)
    assert entry.value.where == Position("f", 2, 7)
    number, mapping = entry.value.items  # type: ignore[union-attr]
    assert number == ScalarNode(10, Position("f", 2, 8))
    assert mapping.entries[0].value.where == Position("f", 2, 16)


def test_anchors_and_merge_keys() -> None:
    text = "a: &a {p: 1, q: 2}\nb: {<<: *a, q: 3}\nc: {<<: [*a, {q: 5, r: 4}], s: 6}\nd: *a\n"
    data = read(text)
    assert data["b"] == {"q": 3, "p": 1}
    assert data["c"] == {"s": 6, "p": 1, "q": 2, "r": 4}
    assert data["d"] == {"p": 1, "q": 2}


def test_merged_values_keep_the_place_they_are_written_at() -> None:
    problems = Problems()
    node = read_value("a: &a {p: 1}\nb: {<<: *a}\n", "f", problems)
    assert isinstance(node, MapNode)
    merged = node.entries[1].value
    assert isinstance(merged, MapNode)
    assert merged.entries[0].key_where == Position("f", 1, 8)


def test_a_quoted_merge_key_is_a_key() -> None:
    assert read("{'<<': 1}") == {"<<": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\na: 2", "f:2:1: key 'a' is there twice"),
        ("a: [1", "f:1:6: did not find expected ',' or ']'"),
        ("a:\n\tb: 1", "f:2:1: a tab where YAML wants spaces"),
        ("a: b: c", "f:1:5: mapping values are not allowed in this context"),
        ("a: !foo 1", "f:1:4: tag !foo means nothing here"),
        ("a: !!int x", "f:1:4: 'x' cannot be read as !!int"),
        ("? [1]\n: 2", "f:1:3: a key must be text, not a collection"),
        ("&a [*a]", "f:1:5: an alias inside what it stands for"),
        ("{<<: 3}", "f:1:2: << merges mappings, given as an alias such as *name"),
        ("a\n---\nb", "f:2:1: a second document; a graph file holds one"),
        ("a: *b", "f:1:4: no anchor called &b before this alias"),
        (
            "a: \x00",
            "f:1:4: a character that YAML forbids: control characters are not allowed",
        ),
        ("[" * 500, "f:1:101: nested more than 100 levels deep"),
    ],
)
def test_mistakes(text: str, message: str) -> None:
    assert messages(text) == [message]


def test_a_hostile_depth_is_refused() -> None:
    # at our own limit or at libyaml's, by its version
    (message,) = messages("[" * 100_000)
    assert message.endswith(": nested more than 100 levels deep")


def test_aliases_that_explode_are_refused() -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    found = messages("\n".join(lines))
    assert len(found) == 1
    assert "more than 200000 values once the aliases are expanded" in found[0]


@pytest.mark.parametrize("text", ["", "# nothing\n", "[1, 2]", "3"])
def test_a_graph_file_is_a_mapping(text: str) -> None:
    problems = Problems()
    assert read_mapping(text, "f", problems) is None
    assert [p.message for p in problems.report("f").problems] == ["a graph file is a mapping"]


values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
    | st.sampled_from(["1e-3", "on", "null", "- a", "a: b", "$k", "70 N", "block.port", "x #y"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text("abn_ -:1", min_size=1, max_size=4), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(values)
def test_printed_values_read_back_the_same(value: object) -> None:
    text = text_of(value)
    found = read(f"key: {text}")["key"]
    if not (isinstance(value, str) and any(c in value for c in "￾￿")):
        assert found == value
        assert repr(found) == repr(value)


@given(st.text(max_size=60))
def test_no_text_crashes_the_reader(text: str) -> None:
    problems = Problems()
    read_mapping(text, "f", problems)
    problems.report("f").text()


@pytest.mark.parametrize(
    ("encoding", "where", "found", "fix"),
    [
        ("latin-1", "2:5", "byte 0xf6, in Latin-1 'ö'", "ISO-8859-1"),
        ("utf-16", "1:1", "UTF-16", "UTF-16"),
    ],
)
def test_a_file_that_is_not_utf_8(
    tmp_path: Path, encoding: str, where: str, found: str, fix: str
) -> None:
    path = tmp_path / "graph.yaml"
    path.write_bytes("rate: 1\n# grö\n".encode(encoding))
    problems = Problems()
    assert read_file(path, "graph.yaml", problems) is None
    (problem,) = problems.report("graph.yaml").problems
    assert str(problem.where) == f"graph.yaml:{where}"
    assert problem.found == found
    assert f"iconv -f {fix} -t UTF-8 graph.yaml" in problem.fix


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    (tmp_path / "graph.yaml").write_text("rate: 1\n", encoding="utf-8-sig")
    problems = Problems()
    tree = read_file(tmp_path / "graph.yaml", "graph.yaml", problems)
    assert tree is not None and tree.entries[0].key == "rate"


def test_letters_that_a_name_cannot_have(tmp_path: Path) -> None:
    path = tmp_path / "graph.yaml"
    path.write_text("rate: 100 Hz\nblocks:\n  größe: {use: blocks.SineWave}\n")
    (problem,) = check(path).problems
    assert problem.expected.startswith("a letter from a to z or A to Z")
    assert problem.fix == "groesse"
