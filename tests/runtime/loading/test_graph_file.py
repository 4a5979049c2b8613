"""The declared keys of a graph file, and the sections that are checked by them."""

from typing import Any

import pytest

from aloft.files.document import read_mapping
from aloft.files.problems import Code, Problems
from aloft.runtime.loading.reading.graph_file import (
    BLOCK_KEYS,
    WIRE_KEYS,
    ClockKeys,
    Links,
    read_section,
)


def read(text: str, model: type[ClockKeys] | type[Links]) -> tuple[dict[str, Any], Problems]:
    problems = Problems()
    node = read_mapping(text, "graph.yaml", problems)
    assert node is not None
    return read_section(node, "section", model, problems), problems


def test_keys_are_those_that_are_written() -> None:
    assert BLOCK_KEYS == ("use", "with", "in", "rate", "offset", "on", "background")
    assert WIRE_KEYS == ("from", "delay", "initial", "allow", "value")


def test_all_mistakes_of_a_section_are_reported_and_the_rest_is_kept() -> None:
    text = "kind: paced\noverun: stop\nstop_after: true\nhangs_after: 3 Hz\n"
    given, problems = read(text, ClockKeys)
    found = problems.report("graph.yaml").problems
    assert given == {"kind": "paced"}
    assert [(p.code, p.where.line) for p in found] == [
        (Code.UNKNOWN_KEY, 2), (Code.BAD_VALUE, 3), (Code.BAD_VALUE, 4)
    ]  # fmt: skip
    assert found[0].nearest == ("overrun",) and found[2].at == "section.hangs_after"


@pytest.mark.parametrize("text", ["of: 3", "of: {one: [1]}", "watch: 1", "paths: []"])
def test_a_value_of_the_wrong_kind(text: str) -> None:
    given, problems = read(text, Links)
    assert given == {}
    assert [p.code for p in problems.report("graph.yaml").problems] == [Code.WRONG_KIND]


def test_braces_in_a_text_are_shown_as_they_are() -> None:
    _, problems = read("max_age: 'a {expected} s'", Links)
    (problem,) = problems.report("graph.yaml").problems
    assert "a {expected} s" in problem.message.partition(":")[0]
