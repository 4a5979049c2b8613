"""Runs that Python steps: signals, inputs, reset, snapshots, and what is refused."""

import gc
import pickle
from pathlib import Path

import numpy as np
import pytest

from aloft import AloftError, Graph, GraphBuilder, LoadError, RunResult, load
from aloft.runtime.language.errors import RunError
from aloft.runtime.loading.checking.parameters import adjust

LOOP = {
    "rate": "100 Hz",
    "duration": "1 s",
    "blocks": {
        "push": {"use": "blocks.External", "with": {"n": 2, "unit": "m/s", "initial": 1.0}},
        "noise": {"use": "blocks.WhiteNoise", "with": {"n": 2, "unit": "m/s", "seed": 1}},
        "sum": {"use": "blocks.Sum", "with": {"n": 2}, "in": {"a": "push.y", "b": "noise.y"}},
        "place": {"use": "blocks.Integrator", "with": {"n": 2}, "in": {"u": "sum.y"}},
    },
}


@pytest.fixture
def graph() -> Graph:
    return load(LOOP)


def test_a_stepped_run_is_that_of_the_executor(graph: Graph) -> None:
    whole = graph.run(log=True).signal("place.y.value")
    with graph.open() as run:
        assert run.step(3) == 3
        assert np.array_equal(run["place.y.value"], whole[2])
        assert run.step(40) == 40
        assert np.array_equal(run["place.y"].value, whole[42])
        assert (run.tick, run.time) == (43, pytest.approx(0.43))
        assert run.step(100) == 57  # to the end of the duration
        assert run.reason == "the duration is over" and run.step() == 0


def test_inputs_are_set_between_steps(graph: Graph) -> None:
    with graph.open() as run:
        run.step()
        assert run["push.y.value"].tolist() == [1.0, 1.0]
        run["push"] = [3.0, 4.0]
        run.step()
        assert run["push.y.value"].tolist() == [3.0, 4.0]
        run["push.y"] = 0.5
        run.step()
        assert run["push.y.value"].tolist() == [0.5, 0.5]


def test_what_is_read_is_a_copy(graph: Graph) -> None:
    with graph.open() as run:
        run.step()
        run["place.y"].value[:] = 7.0
        run["place.y.value"][:] = 7.0
        assert run["place.y.value"].tolist() == [0.0, 0.0]


def test_reset_and_snapshots_repeat_every_byte(graph: Graph) -> None:
    with graph.open() as run:
        run.step(5)
        kept = run.snapshot()
        run["push"] = 9.0
        run.step(5)
        run.restore(kept)
        assert run.tick == 5
        run.step(5)
        again = run.snapshot()
        run.reset()
        assert run.tick == 0
        run.step(10)
        assert run.snapshot() == again


def test_live_parameters_change_between_steps_and_the_outcome_is_there_at_any_time(
    graph: Graph,
) -> None:
    with graph.open() as run:
        run.step(20)
        before = run.snapshot()
        run.step()
        kept = run["place.y.value"]
        run.restore(before)
        noise = run.block("noise")
        run.change(adjust({"noise": noise}, {"noise.std": 0.0}))
        run.step(2)
        assert not np.array_equal(run["place.y.value"], kept)
        assert np.array_equal(run["sum.y.value"], [1.0, 1.0])
        result = run.result()
        assert (result.success, result.ticks, result.error) == (True, 22, None)
        broken = run.result(RunError("it broke", block="noise", tick=3))
        assert (broken.success, broken.reason) == (False, "it broke")
        assert run.step() == 1  # the blocks live on
    with pytest.raises(AloftError, match="this run is stopped"):
        run.change(adjust({"noise": noise}, {"noise.std": 1.0}))


def test_a_live_parameter_is_read_and_set_by_its_name(graph: Graph) -> None:
    with graph.open() as run:
        run.step(3)
        run["noise.std"] = np.float64(0.0)
        run.step()
        assert run["noise.std"] == 0.0
        assert np.array_equal(run["sum.y.value"], [1.0, 1.0])
        run.reset()
        assert run["noise.std"] == 0.0
        for name, message in (
            ("noise.sdt", "no parameter 'sdt'"), ("noise.seed", "cannot be changed while the graph runs"),
        ):  # fmt: skip
            with pytest.raises(LoadError, match=message):
                run[name] = 1
        with pytest.raises(KeyError, match=r"neither a block blocks\.External nor a parameter"):
            run["noise.y"] = 1.0


def test_a_seed_changes_every_seed(graph: Graph) -> None:
    with graph.open(seed=3) as a, graph.open(seed=4) as b, graph.with_seed(3).open() as c:
        for run in (a, b, c):
            run.step(2)
        assert np.array_equal(a["noise.y.value"], c["noise.y.value"])
        assert not np.array_equal(a["noise.y.value"], b["noise.y.value"])


def test_what_is_refused(graph: Graph) -> None:
    with graph.open() as run:
        with pytest.raises(KeyError, match=r"no signal .place\.z.; the nearest is place\.y"):
            run["place.z"]
        with pytest.raises(
            KeyError, match=r"neither a block blocks\.External nor a parameter, .*: push"
        ):
            run["place"] = 1.0
        with pytest.raises(ValueError, match=r"push has shape \(2,\), not \(3,\)"):
            run["push"] = [1.0, 2.0, 3.0]
        with pytest.raises(ValueError, match="push cannot be set to what is not finite"):
            run["push"] = np.nan
        with pytest.raises(AloftError, match="by at least 1 tick, not 0"):
            run.step(0)
    with pytest.raises(AloftError, match="this run is stopped; open the graph again"):
        run.step()
    run.close()


def test_a_failing_block_names_itself_and_the_run_is_closed(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(
        "from aloft import Block, Output, Field, Signal\n"
        "class One(Signal):\n    value = Field(text='a number')\n"
        "class Bad(Block):\n    y = Output(One, text='a number')\n"
        "    closed = []\n"
        "    def step(self):\n        if self.tick == 2:\n            raise ValueError('broken')\n"
        "    def close(self):\n        self.closed.append(1)\n"
    )
    graph = load("rate: 10\nblocks:\n  b: {use: bad:Bad}\n", path=tmp_path / "g.yaml")
    with pytest.raises(RunError, match="block 'b' failed at tick 2"), graph.open() as run:
        run.step(5)
    assert graph.checked.block("b").block_type.closed == [1]  # type: ignore[attr-defined]


def test_texts_and_mappings_load_like_files(tmp_path: Path) -> None:
    text = "rate: 10\nduration: 1 s\nblocks:\n  c: {use: blocks.Constant, with: {value: [1]}}\n"
    (tmp_path / "g.yaml").write_text(text)
    assert load(text).run().run_hash == load(tmp_path / "g.yaml").run().run_hash
    with pytest.raises(LoadError, match=r"mine.yaml:2:4: unknown-key: 'rat'|unknown-key"):
        load(
            "rate: 1\nblocks: {c: {use: blocks.Constant, with: {value: [1]}, rat: 2}}\n",
            path="mine.yaml",
        )


def test_results_are_short_and_can_be_pickled(graph: Graph) -> None:
    result = graph.run(log=True)
    again: RunResult = pickle.loads(pickle.dumps(result))
    assert again.run_hash == result.run_hash and again.graph is None
    assert np.array_equal(again.signal("place.y.value"), result.signal("place.y.value"))
    assert len(repr(graph)) < 200 and len(repr(result)) < 250
    assert graph._repr_html_().startswith("<svg ")
    assert result._repr_html_().startswith("<p><b>success: ")
    with graph.open() as run:
        assert repr(run) == "<SteppedRun of 'graph': tick 0, may go on>"


def test_an_edited_module_is_read_again(tmp_path: Path) -> None:
    source = (
        "from aloft import Block, Output, Field, Signal\n"
        "class One(Signal):\n    value = Field(text='a number')\n"
        "class Same(Block):\n    y = Output(One, text='a number')\n"
        "    def step(self):\n        self.y.value[...] = %d\n"
    )
    text = "rate: 10\nduration: 0.1 s\nblocks:\n  b: {use: edited_block:Same}\n"
    found = []
    for number in (1, 2, 3):
        (tmp_path / "edited_block.py").write_text(source % number)
        result = load(text, path=tmp_path / "g.yaml").run(log=True)
        found.append(float(result.signal("b.y.value")[-1]))
    assert found == [1.0, 2.0, 3.0]


def test_a_graph_is_built_in_python_and_is_the_one_of_its_yaml() -> None:
    builder = GraphBuilder(rate="100 Hz", duration="0.2 s")
    wish = builder.add("wish", "blocks.SineWave", amplitude=2.0)
    error = builder.add("error", "blocks.Sum", weights=[1, -1])
    rate = builder.add("rate", "blocks.Gain", {"u": error.y}, gain="4 1/s")
    position = builder.add("position", "blocks.Integrator", {"u": rate.y.value[0]}, rate="50 Hz")
    builder.wire("error.a", wish.y)
    builder.wire("error.b", position.y, delay=2, initial={"value": [0.5]})
    text = builder.yaml()
    assert 'in: {u: "rate.y.value[0]"}' in text
    assert "b: {from: position.y, delay: 2, initial: {value: [0.5]}}" in text
    assert builder.build().run().run_hash == load(text).run().run_hash
    assert repr(builder) == "<GraphBuilder 'graph': 4 blocks>"


def test_mistakes_of_a_builder() -> None:
    builder = GraphBuilder(rate="100 Hz")
    one = builder.add("one", "blocks.Constant", value=[1.0])
    with pytest.raises(AloftError, match="there are two blocks 'one'"):
        builder.add("one", "blocks.Constant", value=[1.0])
    gain = builder.add("gain", "blocks.Gain", {"u": one.z})
    with pytest.raises(AloftError, match=r"gain.u is wired already"):
        builder.wire("gain.u", one.y)
    with pytest.raises(AloftError, match="there is no block 'gian'; the nearest is gain"):
        builder.wire("gian.u", gain.y)
    with pytest.raises(
        LoadError, match=r"graph.yaml:\d+:\d+: unknown-source: one .* has no output 'z'"
    ):
        builder.build()


def test_many_runs_leave_nothing_behind(graph: Graph) -> None:
    import weakref

    with graph.open() as run:
        run.step()
    seen = weakref.ref(run)
    del run
    gc.collect()
    assert seen() is None
