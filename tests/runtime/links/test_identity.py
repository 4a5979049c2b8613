"""Parts of different graphs name both hashes and the first difference."""

from pathlib import Path

from aloft.runtime.links.identity import Identity
from aloft.runtime.loading import checked_text
from aloft.runtime.placement.placed import split_over_machines

TEXT = """
rate: 100 Hz
machines: {a: tcp/127.0.0.1:7450, b: tcp/127.0.0.1:7451}
blocks:
  source: {use: blocks.Constant, with: {value: [1.0, 2.0]}}
  gain: {use: blocks.Gain, with: {gain: 2.0, n: 2}, in: {u: source.y}, on: b}
"""


def identity(text: str) -> Identity:
    return Identity.of(split_over_machines(checked_text(text, Path("graph.yaml"))))


def test_the_same_graph() -> None:
    assert identity(TEXT) == identity(TEXT)
    assert identity(TEXT).difference(identity(TEXT), "a", "b") == ""


def test_another_parameter_is_another_graph_of_the_same_schema() -> None:
    here, there = identity(TEXT), identity(TEXT.replace("gain: 2.0", "gain: 3.0"))
    assert here.schema_hash == there.schema_hash
    text = here.difference(there, "a", "b")
    assert text == (
        f"the graph is {here.graph_hash} on a and {there.graph_hash} on b; the first difference "
        "is 'with: {gain: 2.0, n: 2}' on a, 'with: {gain: 3.0, n: 2}' on b"
    )


def test_a_block_with_other_outputs_is_another_schema() -> None:
    here = identity(TEXT)
    changed = tuple(line.replace("float64[n]", "float64[m]") for line in here.schema)
    text = here.difference(Identity(here.graph, changed), "a", "b")
    assert text.startswith(f"the schema is {here.schema_hash} on a and ")
    assert "'source.y.value: float64[n]' on a, 'source.y.value: float64[m]' on b" in text


def test_a_graph_with_a_further_line() -> None:
    here = identity(TEXT)
    there = Identity((*here.graph, "  more:"), here.schema)
    assert here.difference(there, "a", "b").endswith(
        "the first difference is 'nothing' on a, 'more:' on b"
    )
