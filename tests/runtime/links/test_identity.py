"""Parts of different graphs name both hashes and the first difference."""

from pathlib import Path

import pytest

from aloft import __version__
from aloft.runtime.language import code_digest
from aloft.runtime.links import identity as module
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


def test_another_version_is_another_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    here = identity(TEXT)
    monkeypatch.setattr(module, "__version__", "9.9")
    there = identity(TEXT)
    assert here.difference(there, "a", "b") == (
        f"the graph is {here.graph_hash} on a and {there.graph_hash} on b; the first difference "
        f"is 'aloft {__version__}' on a, 'aloft 9.9' on b"
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


OWN = """
from aloft import Block, Field, Output, Signal
from helper import FACTOR

class Number(Signal):
    value = Field(text="a number")

class Source(Block):
    y = Output(Number)

    def step(self):
        self.y.value[()] = FACTOR
"""


def test_the_same_graph_with_other_code_names_the_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = """
rate: 100 Hz
machines: {a: tcp/127.0.0.1:7450, b: tcp/127.0.0.1:7451}
blocks: {source: {use: "own_of_identity:Source"}}
"""
    (tmp_path / "own_of_identity.py").write_text(OWN)
    (tmp_path / "helper.py").write_text("FACTOR = 1.0")
    monkeypatch.syspath_prepend(tmp_path)
    placed = split_over_machines(checked_text(text, tmp_path / "graph.yaml"))
    here = Identity.of(placed)
    code_digest._module_digest.cache_clear()
    code_digest._class_digest.cache_clear()
    assert Identity.of(placed) == here
    (tmp_path / "helper.py").write_text("FACTOR = 2.0")  # what the block's module imports counts
    code_digest._module_digest.cache_clear()
    code_digest._class_digest.cache_clear()
    there = Identity.of(placed)
    assert (here.graph_hash, here.schema_hash) == (there.graph_hash, there.schema_hash)
    difference = here.difference(there, "a", "b")
    assert difference.startswith(f"the code is {here.code_hash} on a and {there.code_hash} on b")
    assert "'code of source, own_of_identity:Source: " in difference
    assert difference.endswith("; all machines need the same files")


def test_code_that_all_blocks_share_is_compared_by_folder() -> None:
    here = identity(TEXT)
    folders = [line.partition(":")[0] for line in here.code if line.startswith("code in")]
    assert "code in aloft/mathematics" in folders and "code in aloft/runtime" in folders
    lines = [line for line in here.code if line.startswith("code of gain, ")]
    assert len(lines) >= 1 and "aloft.blocks" in lines[0] and ":Gain: " in lines[0]
    changed = tuple(line + "0" if "aloft/robots" in line else line for line in here.code)
    there = Identity(here.graph, here.schema, changed)
    assert "'code in aloft/robots: " in here.difference(there, "a", "b")
