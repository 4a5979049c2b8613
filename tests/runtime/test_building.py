"""A graph that is built in Python is the file that it writes, and refuses what cannot be meant."""

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.blocks.general.arithmetic import Gain
from aloft.runtime.building import GraphBuilder, Source
from aloft.runtime.language.errors import AloftError


def test_sources_are_written_as_in_a_file() -> None:
    source = Source("robot").joints.position
    assert repr(source[2]) == "<Source robot.joints.position[2]>"
    for index, text in (
        (np.s_[1:3], "[1:3]"), (np.s_[:], "[:]"), (np.s_[2:], "[2:]"), (np.s_[:4], "[:4]"),
        (np.s_[::2], "[::2]"), (np.s_[0, 1:2], "[0, 1:2]"), (np.s_[5:1:-1], "[5:1:-1]"),
    ):  # fmt: skip
        assert source[index].text == f"robot.joints.position{text}"
    with pytest.raises(AttributeError):
        source.__wrapped__  # noqa: B018


def loop() -> GraphBuilder:
    graph = GraphBuilder(name="loop", rate="100 Hz", duration="0.5 s")
    setpoint = graph.add("setpoint", "blocks.Constant", value=np.array([1.0]))
    error = graph.add("error", "blocks.Sum", weights=[1, -1])
    rate = graph.add("rate", Gain, {"u": error.y}, gain="4 1/s")
    graph.add("position", "blocks.Integrator", {"u": rate.y}, on=None)
    graph.wire("error.a", setpoint.y)
    graph.wire("error.b", Source("position").y)
    return graph


def test_what_is_built_runs_and_is_the_same_graph_as_its_file(tmp_path: Path) -> None:
    graph = loop()
    assert repr(graph) == "<GraphBuilder 'loop': 4 blocks>"
    result = graph.build().run(log=True)
    # x' = 4 (1 - x) by Euler's method
    expected = 1.0 - (1.0 - 4.0 * 0.01) ** np.arange(50)
    np.testing.assert_allclose(result.signal("position.y.value")[:, 0], expected, atol=1e-12)
    graph.write(tmp_path / "loop.yaml")
    text = (tmp_path / "loop.yaml").read_text()
    assert text == graph.yaml() and "    on:" not in text and "offset" not in text
    assert aloft.load(tmp_path / "loop.yaml").run().run_hash == result.run_hash


def test_a_block_may_be_added_in_the_background() -> None:
    graph = GraphBuilder(rate="100 Hz", duration="0.1 s")
    wave = graph.add("wave", "blocks.SineWave")
    graph.add("slow", Gain, {"u": wave.y}, background={"latency": "30 ms", "late": "hold"})
    assert "background: {latency: 30 ms, late: hold}" in graph.yaml()
    assert graph.build().checked.block("slow").block_type.delay_runs == 3


def test_rates_offsets_and_delays_are_written_where_they_are_given() -> None:
    graph = GraphBuilder(rate="100 Hz")
    source = graph.add("a", "blocks.Constant", value=[1.0], rate="50 Hz", offset=1, on="left")
    graph.add("b", "blocks.Gain")
    graph.wire("b.u", source.y, delay=2, initial={"value": [3.0]}, allow="rate")
    lines = graph.yaml().splitlines()
    assert lines == [
        "rate: 100 Hz", "blocks:", "  a:", "    use: blocks.Constant", "    with: {value: [1.0]}",
        "    rate: 50 Hz", "    offset: 1", "    on: left", "  b:", "    use: blocks.Gain",
        "    in: {u: {from: a.y, delay: 2, initial: {value: [3.0]}, allow: rate}}",
    ]  # fmt: skip
    graph.add("c", "blocks.Gain")
    graph.wire("c.u", source.y, allow="unit")
    assert graph.yaml().endswith("in: {u: {from: a.y, allow: unit}}\n")
    assert GraphBuilder(rate=5).yaml() == "rate: 5\nblocks: {}\n"


def test_what_cannot_be_meant_is_refused() -> None:
    graph = loop()
    with pytest.raises(AloftError, match="there are two blocks 'rate'"):
        graph.add("rate", "blocks.Gain")
    with pytest.raises(AloftError, match="there is no block 'eror'; the nearest is error"):
        graph.wire("eror.a", "setpoint.y")
    with pytest.raises(AloftError, match=r"there is no block 'qqq'$"):
        graph.wire("qqq.a", "setpoint.y")
    with pytest.raises(AloftError, match=r"error\.a is wired already"):
        graph.wire("error.a", "setpoint.y")
