"""What may be set on a running graph, and what is said about the rest."""

import pytest

from aloft.files.problems import LoadError
from aloft.runtime.language.registry import find_block
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading.checked import checked_text
from aloft.runtime.loading.checking.parameters import adjust, entries, plain_parameters
from aloft.runtime.running.memory import BoundGraph

TEXT = """
rate: 500 Hz
blocks:
  source: {use: blocks.Constant, with: {value: [1.0, 2.0]}}
  gain: {use: blocks.Gain, with: {n: 2}, in: {u: source.y}}
  contacts: {use: blocks.ContactDetector, in: {switches: {value: {}}}}
  wave: {use: blocks.SineWave}
robot: bruce
"""


@pytest.fixture(scope="module")
def graph() -> BoundGraph:
    checked: CheckedGraph = checked_text(TEXT, "test.yaml")
    return BoundGraph(checked)


def report(graph: BoundGraph, *settings: str) -> str:
    with pytest.raises(LoadError) as error:
        adjust(graph.blocks, settings)
    return str(error.value)


def test_values_are_converted_and_old_ones_kept(graph: BoundGraph) -> None:
    found = adjust(graph.blocks, ["contacts.hold=10 ms", "wave.frequency=2", "wave.frequency=3 Hz"])
    assert found.values == (("contacts.hold", 0.03, 0.01), ("wave.frequency", 1.0, 3.0))
    assert found.params["wave"].model_dump()["frequency"] == 3.0


def test_entries_have_everything_but_what_loading_inserted(graph: BoundGraph) -> None:
    found = {entry.path: entry for entry in entries(graph.blocks)}
    assert found["contacts.hold"].unit == "s" and found["contacts.hold"].live
    assert found["source.value"].value == [1.0, 2.0]
    assert not found["gain.n"].live
    assert not any("~" in path for path in found)


def test_mistakes_read_as_they_do_at_load(graph: BoundGraph) -> None:
    text = report(graph, "contacts.hold=-1", "contacts.hodl=1", "gian.gain=3", "wave.frequency=2 m")
    assert "--set contacts.hold=-1: bad-parameter: contacts.hold cannot be -1" in text
    assert "at least 0 s (time for which a point stays active after its switch opens)" in text
    assert "no parameter 'hodl'" in text and "nearest    hold" in text
    assert "there is no block 'gian' in the running graph" in text and "nearest    gain" in text
    assert "wave.frequency cannot be 2 m" in text
    assert text.endswith("the running graph: 4 problems")


def test_what_is_not_live_is_refused_with_the_way_out(graph: BoundGraph) -> None:
    text = report(graph, "gain.n=3")
    assert "gain.n cannot be changed while the graph runs" in text
    assert "a live parameter of this block: gain" in text
    assert "stop the run, and start it with --set gain.n=..." in text
    assert "rate belongs to the graph, which cannot change while it runs" in report(graph, "rate=3")


def test_a_size_cannot_change(graph: BoundGraph) -> None:
    assert "would change the size of source.y.value" in report(graph, "source.value=[1.0]")


def test_plain_parameters_read_back_as_the_same() -> None:
    kind = find_block("blocks.StateMachine")  # keys of its transitions are words of Python
    params = kind.Params.model_validate(kind.example_parameters())
    assert kind.Params.model_validate(plain_parameters(params)) == params
