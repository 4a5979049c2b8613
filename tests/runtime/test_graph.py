"""The facade: load once, run as often as you like, every signal of every tick at hand."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import aloft

GRAPH = """
rate: 100 Hz
duration: 0.5 s
blocks:
  wave: {use: blocks.SineWave, with: {amplitude: 2.0, frequency: 1.0}}
  position: {use: blocks.Integrator, in: {u: wave.y}}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "wave.yaml"
    file.write_text(GRAPH)
    return file


def test_every_signal_of_every_tick(path: Path) -> None:
    result = aloft.load(path).run()
    assert result.success
    wave = result.signal("wave.y.value")
    assert wave.shape == (50, 1)
    np.testing.assert_allclose(wave[:, 0], 2.0 * np.sin(2 * np.pi * result.time), atol=1e-12)
    position = result.signal("position.y.value")[:, 0]
    np.testing.assert_allclose(np.diff(position), 0.01 * wave[:-1, 0], atol=1e-15)


@pytest.mark.parametrize("overrides", [{"wave.amplitude": 4}, ["wave.amplitude=4"]])
def test_overrides_as_a_mapping_or_as_texts(path: Path, overrides: object) -> None:
    graph = aloft.load(path, overrides)  # type: ignore[arg-type]
    assert dict(graph.checked.overrides) == {"wave.amplitude": 4}
    assert np.abs(graph.run().signal("wave.y.value")).max() == pytest.approx(4.0, rel=1e-2)


def test_runs_of_one_graph_do_not_meet(path: Path) -> None:
    graph = aloft.load(path)
    first, second = graph.run(), graph.run()
    assert first.run_hash == second.run_hash
    assert first.signal("wave.y.value").base is not second.signal("wave.y.value").base


def test_the_duration_may_be_another(path: Path) -> None:
    assert aloft.load(path).run(0.2).ticks == 20
    with pytest.raises(aloft.AloftError, match=r"0\.001 s is shorter than one tick"):
        aloft.load(path).run(0.001)


def test_a_wrong_graph_raises_the_whole_report(path: Path) -> None:
    with pytest.raises(
        aloft.LoadError, match=r"wave\.wave: there is no block 'wav'|'wav'"
    ) as error:
        aloft.load(path, {"wav.amplitude": 1, "position.initial": "far"})
    assert len(error.value.report.problems) == 2


def test_seed_parameters_are_found_everywhere() -> None:
    jump = Path(aloft.__file__).parent / "graphs" / "jump.yaml"
    assert "robot.seed" in aloft.load(jump).seed_parameters


NOISE = """\
rate: 100
duration: 0.1
blocks: {noise: {use: blocks.WhiteNoise, with: {seed: 1}}}
"""


def test_a_run_may_have_another_seed() -> None:
    graph = aloft.load(NOISE)
    assert graph.seed_parameters == ("noise.seed",)
    hashes = {graph.run(seed=seed).run_hash for seed in (1, 2)}
    assert len(hashes) == 2
    assert graph.run(seed=1).run_hash == graph.run().run_hash


def test_the_package_offers_what_users_need_and_nothing_else() -> None:
    for name in aloft.__all__:
        assert getattr(aloft, name) is not None
    assert set(aloft.__all__) <= set(dir(aloft))
    with pytest.raises(AttributeError, match="has no attribute 'laod'"):
        aloft.laod  # noqa: B018


def test_short_texts_for_a_notebook(path: Path) -> None:
    graph = aloft.load(path)
    assert repr(graph) == "<Graph 'wave': 2 blocks at 100 Hz, 0.5 s>"
    shown = repr(graph.run())
    assert shown.startswith("<RunResult: success: ran to its end; 50 ticks, 0.5 s, 50 ticks logged")
    assert len(shown) < 200


def test_a_result_can_be_pickled(path: Path) -> None:
    result = aloft.load(path).run()
    again = pickle.loads(pickle.dumps(result))
    assert again.to_json() == result.to_json()
    np.testing.assert_array_equal(again.signal("wave.y.value"), result.signal("wave.y.value"))
    np.testing.assert_array_equal(again.time, result.time)
    empty = pickle.loads(pickle.dumps(aloft.load(path).run(log=False)))
    assert empty.log is None
