"""Includes, sub-graphs, parameters and overrides: what they expand to, and what runs then."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.files.nodes import plain
from aloft.runtime.graph import Graph
from aloft.runtime.loading import LoadError, checked_file, checked_text, flatten

LEG = """
inputs: {u: }
outputs: {y: second.y, between: first.y}
parameters: {gain: 1.0, n: 2}
blocks:
  first: {use: blocks.Gain, with: {gain: $gain, n: $n}, in: {u: inputs.u}}
  second: {use: blocks.Gain, with: {gain: 10.0, n: $n}, in: {u: first.y}}
"""
BODY = """
inputs: {u: }
outputs: {left: left.y, right: right.y, sum: sum.y, straight: inputs.u}
parameters: {gain: }
blocks:
  left: {use: leg.yaml, with: {gain: $gain}, in: {u: inputs.u}}
  right: {use: leg.yaml, with: {gain: 3.0}, in: {u: left.y}}
  sum: {use: blocks.Sum, with: {n: 2}, in: {a: left.y, b: right.y}}
"""
GRAPH = """
rate: 100 Hz
duration: 50 ms
blocks:
  source: {use: blocks.Constant, with: {value: [1.0, -2.0]}}
  one: {use: body.yaml, with: {gain: 2.0}, in: {u: source.y}}
  two: {use: body.yaml, with: {gain: 5.0}, in: {u: {from: one.sum, delay: 2}}}
  last: {use: blocks.Gain, with: {n: 2}, in: {u: two/right/first.y}}
"""


def write(folder: Path, **files: str) -> Path:
    """Write ``name=text`` as ``name.yaml``; return the one called graph."""
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / "graph.yaml"


def run(path: Path, overrides: Any = ()) -> Any:
    return Graph(checked_file(path, overrides)).run()


def test_subgraphs_used_many_times_and_nested(tmp_path: Path) -> None:
    path = write(tmp_path, leg=LEG, body=BODY, graph=GRAPH)
    result = run(path)
    source = np.array([1.0, -2.0])
    np.testing.assert_array_equal(result.signal("one/left/first.y.value")[-1], 2 * source)
    np.testing.assert_array_equal(result.signal("one/left/second.y.value")[-1], 20 * source)
    np.testing.assert_array_equal(result.signal("one/right/second.y.value")[-1], 600 * source)
    np.testing.assert_array_equal(result.signal("one/sum.y.value")[-1], 620 * source)
    # two reads it two ticks late: 0 0 620 620 620, times its own gains
    last = result.signal("last.y.value")
    assert last.shape == (5, 2)
    np.testing.assert_array_equal(last[:2], np.zeros((2, 2)))
    np.testing.assert_array_equal(last[2:], np.tile(620 * 50 * 3 * source, (3, 1)))


def test_flat_text_loads_to_the_same_graph(tmp_path: Path) -> None:
    path = write(tmp_path, leg=LEG, body=BODY, graph=GRAPH)
    graph = checked_file(path, {"one.gain": 7.0, "rate": "200 Hz"})
    again = checked_text(graph.text, path)
    assert again.text == graph.text
    assert again.order == graph.order
    assert [b.params for b in again.blocks] == [b.params for b in graph.blocks]
    assert Graph(again).run().run_hash == Graph(graph).run().run_hash


def test_flat_text(tmp_path: Path) -> None:
    graph = """
rate: 100 Hz
blocks:
  source: {use: blocks.Constant, with: {value: [1e-7, -2.0]}}
  leg: {use: leg.yaml, rate: 50 Hz, in: {u: {from: source.y, delay: 1, initial: {value: 3}}}}
set: {leg.gain: 4, leg/second.gain: 5}
"""
    assert flatten(write(tmp_path, leg=LEG, graph=graph)).text == (
        "rate: 100 Hz\n"
        "blocks:\n"
        "  source:\n"
        "    use: blocks.Constant\n"
        "    with: {value: [1.0e-07, -2.0]}\n"
        "  leg/first:\n"
        "    use: blocks.Gain\n"
        "    with: {gain: 4, n: 2}\n"
        "    in: {u: {from: source.y, delay: 1, initial: {value: 3}}}\n"
        "    rate: 50 Hz\n"
        "  leg/second:\n"
        "    use: blocks.Gain\n"
        "    with: {gain: 5, n: 2}\n"
        "    in: {u: leg/first.y}\n"
        "    rate: 50 Hz\n"
    )


def gain_of(path: Path, overrides: Any = ()) -> float:
    return checked_file(path, overrides).block("gain").params.gain  # type: ignore[attr-defined,no-any-return]


def test_precedence_of_overrides(tmp_path: Path) -> None:
    block = """
  source: {use: blocks.Constant, with: {value: [1.0]}}
  gain: {use: blocks.Gain, in: {u: source.y}"""
    plain = f"rate: 1 Hz\nblocks:{block}}}"
    assert gain_of(write(tmp_path, graph=plain)) == 1.0
    given = f"rate: 1 Hz\nblocks:{block}, with: {{gain: 2}}}}"
    assert gain_of(write(tmp_path, graph=given)) == 2.0
    first = f"blocks:{block}, with: {{gain: 2}}}}\nset: {{gain.gain: 3}}"
    second = "set: {gain.gain: 4}"
    include = "rate: 1 Hz\ninclude: [first.yaml, second.yaml]\n"
    files = {"first": first, "second": second}
    assert gain_of(write(tmp_path, graph="rate: 1 Hz\ninclude: first.yaml", **files)) == 3.0
    assert gain_of(write(tmp_path, graph=include, **files)) == 4.0
    own = include + "set: {gain.gain: 5}"
    path = write(tmp_path, graph=own, **files)
    assert gain_of(path) == 5.0
    assert gain_of(path, ["gain.gain=6"]) == 6.0
    assert gain_of(path, ["gain.gain=6", "gain.gain=7"]) == 7.0
    assert gain_of(path, {"gain.gain": np.float64(8.0)}) == 8.0
    assert checked_file(path, ["gain.gain=6"]).overrides == {"gain.gain": 6}


def test_outer_set_wins_over_a_subgraphs_own(tmp_path: Path) -> None:
    leg = LEG + "set: {first.gain: 8, second.gain: 9}\n"
    leg = leg.replace("parameters: {gain: 1.0, n: 2}", "parameters: {n: 2}").replace("$gain", "1")
    graph = """
rate: 1 Hz
blocks:
  source: {use: blocks.Constant, with: {value: [1.0, 1.0]}}
  leg: {use: leg.yaml, in: {u: source.y}}
set: {leg/second.gain: 10}
"""
    loaded = checked_file(write(tmp_path, leg=leg, graph=graph))
    gains = [loaded.block(f"leg/{name}").params.gain for name in ("first", "second")]  # type: ignore[attr-defined]
    assert gains == [8.0, 10.0]


def test_another_block_in_its_place(tmp_path: Path) -> None:
    graph = GRAPH.replace("rate: 100 Hz\nduration: 50 ms", "")
    own = "rate: 100 Hz\ninclude: [part.yaml]\nset: {last.use: runtime.Delay}\n"
    path = write(tmp_path, leg=LEG, body=BODY, part=graph, graph=own)
    with pytest.raises(LoadError) as told:
        checked_file(path, {"one/left/second.use": "runtime.Nothing"})
    assert "--set one/left/second.use=runtime.Nothing" in str(told.value)
    replaced = flatten(path, ["last.use=leg.yaml", "last.gain=3"]).text
    assert "  last/second:\n    use: blocks.Gain\n" in replaced
    assert "  last:\n    use: runtime.Delay\n" in flatten(path).text


def test_overrides_of_the_graph_itself(tmp_path: Path) -> None:
    path = write(tmp_path, leg=LEG, body=BODY, graph=GRAPH)
    graph = checked_file(path, ["rate=1 kHz", "duration=2", "clock.kind=paced", "dimensions.m=4"])
    assert (graph.base_rate, graph.ticks, graph.clock.kind) == (1000.0, 2000, "paced")
    assert graph.block("last").dimensions["m"] == 4


def test_an_override_deep_inside_the_graph_keeps_the_rest(tmp_path: Path) -> None:
    base = "links: {mode: free, of: {one: {max_age: 2}, two: {watch: true}}}\n"
    graph = "include: base.yaml\nrate: 100 Hz\nlinks: {watchdog: 3}\nblocks: {}\n"
    flat = flatten(write(tmp_path, base=base, graph=graph), ["links.of.one.late=zero"])
    assert flat.links is not None
    assert plain(flat.links) == {
        "mode": "free",
        "of": {"one": {"max_age": 2, "late": "zero"}, "two": {"watch": True}},
        "watchdog": 3,
    }


def test_an_override_inside_a_nested_parameter(tmp_path: Path) -> None:
    (tmp_path / "nested.py").write_text(
        "from aloft.runtime.language.block import Block, Output\n"
        "from aloft.runtime.language.parameters import Parameters, parameter\n"
        "from aloft.blocks.general.vectors import Vector\n"
        "class Nested(Block):\n"
        "    class Params(Parameters):\n"
        "        class Noise(Parameters):\n"
        "            gyro: float = 1.0\n"
        "            bias: float = 2.0\n"
        "        n: int = 1\n"
        "        noise: Noise = parameter(Noise(), text='')\n"
        "    y = Output(Vector)\n"
        "    def step(self): pass\n"
    )
    graph = "rate: 1 Hz\nblocks: {a: {use: nested:Nested, with: {noise: {bias: 3}}}}"
    params: Any = checked_file(write(tmp_path, graph=graph), ["a.noise.gyro=5"]).block("a").params
    assert (params.noise.gyro, params.noise.bias) == (5.0, 3.0)


def test_wires_replace_those_of_included_files(tmp_path: Path) -> None:
    base = """
rate: 50 Hz
blocks:
  one: {use: blocks.Constant, with: {value: [1.0]}}
  gain: {use: blocks.Gain, in: {u: one.y}}
"""
    graph = """
include: base.yaml
rate: 100 Hz
blocks:
  two: {use: blocks.Constant, with: {value: [2.0]}}
wires: {gain.u: two.y}
"""
    loaded = checked_file(write(tmp_path, base=base, graph=graph))
    assert loaded.block("gain").wires["u"].source == "two.y"
    assert loaded.base_rate == 100.0
    assert [block.path for block in loaded.blocks] == ["one", "gain", "two"]


def test_a_file_included_twice_counts_once(tmp_path: Path) -> None:
    common = "blocks: {one: {use: blocks.Constant, with: {value: [1.0]}}}"
    inner = "include: common.yaml\n"
    graph = "rate: 1 Hz\ninclude: [a.yaml, b.yaml, common.yaml]\n"
    loaded = checked_file(write(tmp_path, common=common, a=inner, b=inner, graph=graph))
    assert [block.path for block in loaded.blocks] == ["one"]


def test_includes_are_found_beside_the_file_that_names_them(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    write(tmp_path / "deep", inner="include: ../other.yaml", second=LEG)
    other = """
blocks:
  one: {use: blocks.Constant, with: {value: [1.0, 1.0]}}
  leg: {use: deep/second.yaml, in: {u: one.y}}
"""
    loaded = checked_file(
        write(tmp_path, other=other, graph="rate: 1 Hz\ninclude: deep/inner.yaml")
    )
    assert [block.path for block in loaded.blocks] == ["one", "leg/first", "leg/second"]


def test_anchors_and_underscore_keys(tmp_path: Path) -> None:
    graph = """
rate: 1 Hz
_gains: &gains {gain: 3.0, n: 1}
blocks:
  _template: &gain {use: blocks.Gain, in: {u: one.y}}
  one: {use: blocks.Constant, with: {value: [1.0]}, _note: ignored}
  two: {<<: *gain, with: *gains}
  three: {<<: *gain, with: {<<: *gains, gain: 4.0}}
"""
    loaded = checked_file(write(tmp_path, graph=graph))
    gains = [loaded.block(name).params.gain for name in ("two", "three")]  # type: ignore[attr-defined]
    assert gains == [3.0, 4.0]


DEFAULTS = """
inputs: {needed: , optional_one: optional, fixed: {value: [7.0, 8.0]}}
outputs: {a: a.y, b: b.y}
blocks:
  a: {use: blocks.Sum, with: {n: 2}, in: {a: inputs.needed, b: inputs.fixed}}
  b: {use: defaults_parts:Optional, in: {u: inputs.optional_one}}
"""
DEFAULTS_PARTS = """
from aloft.runtime.language.block import Block, Input, Output
from aloft.runtime.language.parameters import Parameters
from aloft.blocks.general.vectors import Vector
class Optional(Block):
    class Params(Parameters):
        n: int = 2
    u = Input(Vector, default={"value": 5.0})
    y = Output(Vector)
    def step(self):
        self.y.value[...] = self.u.value
"""


def test_defaults_of_subgraph_inputs(tmp_path: Path) -> None:
    (tmp_path / "defaults_parts.py").write_text(DEFAULTS_PARTS)
    graph = """
rate: 1 Hz
duration: 2
blocks:
  one: {use: blocks.Constant, with: {value: [1.0, 2.0]}}
  free: {use: defaults.yaml, in: {needed: one.y}}
  full: {use: defaults.yaml, in: {needed: one.y, optional_one: one.y, fixed: free.a}}
"""
    path = write(tmp_path, defaults=DEFAULTS, graph=graph)
    result = run(path)
    assert result.signal("free/a.y.value")[-1].tolist() == [8.0, 10.0]
    assert result.signal("free/b.y.value")[-1].tolist() == [5.0, 5.0]
    assert result.signal("full/a.y.value")[-1].tolist() == [9.0, 12.0]
    assert result.signal("full/b.y.value")[-1].tolist() == [1.0, 2.0]
    assert checked_file(path).block("free/b").wires == {}


def test_parameters_reach_everything_inside(tmp_path: Path) -> None:
    inner = """
inputs: {u: }
outputs: {y: gain.y}
parameters: {kind: blocks.Gain, rate: 50 Hz, delay: 3, start: 2.0, weights: }
blocks:
  gain: {use: $kind, rate: $rate, in: {u: {from: inputs.u, delay: $delay, initial: {value: $start}}}}
  sum: {use: blocks.Sum, with: {weights: [$start, $weights]}, in: {a: gain.y, b: gain.y}}
set: {gain.gain: $start}
"""
    graph = """
rate: 100 Hz
blocks:
  one: {use: blocks.Constant, with: {value: [1.0]}}
  inner: {use: inner.yaml, with: {weights: 4.5}, in: {u: one.y}}
"""
    loaded = checked_file(write(tmp_path, inner=inner, graph=graph))
    gain, total = loaded.block("inner/gain"), loaded.block("inner/sum")
    assert gain.period_ticks == 2
    assert (gain.wires["u"].delay, gain.wires["u"].initial) == (3, {"value": 2.0})
    assert gain.params.gain == 2.0  # type: ignore[attr-defined]
    assert total.params.weights == [2.0, 4.5]  # type: ignore[attr-defined]


def test_dollars_in_texts_survive_the_flat_text(tmp_path: Path) -> None:
    (tmp_path / "texts.py").write_text(
        "from aloft.runtime.language.block import Block, Output\n"
        "from aloft.runtime.language.parameters import Parameters\n"
        "from aloft.blocks.general.vectors import Vector\n"
        "class Text(Block):\n"
        "    class Params(Parameters):\n"
        "        n: int = 1\n"
        "        text: str = ''\n"
        "    y = Output(Vector)\n"
        "    def step(self): pass\n"
    )
    path = write(tmp_path, graph="rate: 1 Hz\nblocks: {a: {use: texts:Text, with: {text: $$HOME}}}")
    graph = checked_file(path)
    assert graph.block("a").params.text == "$HOME"  # type: ignore[attr-defined]
    assert checked_text(graph.text, path).block("a").params == graph.block("a").params


def test_flatten_raises_what_it_cannot_expand(tmp_path: Path) -> None:
    with pytest.raises(LoadError, match="there is no file"):
        flatten(write(tmp_path, graph="rate: 1 Hz\ninclude: nowhere.yaml"))


@pytest.mark.long
def test_too_many_blocks_are_refused(tmp_path: Path) -> None:
    files = {"level0": "blocks: {a: {use: blocks.SineWave}}"}
    for i in range(1, 15):
        below = f"level{i - 1}.yaml"
        files[f"level{i}"] = f"blocks: {{a: {{use: {below}}}, b: {{use: {below}}}}}"
    graph = "rate: 1 Hz\nblocks: {top: {use: level14.yaml}}"
    with pytest.raises(LoadError, match="more than 5000 blocks"):
        checked_file(write(tmp_path, graph=graph, **files))
