"""Runs that go on from the state of a recorded one."""

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import branch
from aloft.logs.recording.recorder import Recorder
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import ReplayError

TEXT = """
rate: 100 Hz
duration: 3 s
blocks:
  r: {use: blocks.WhiteNoise, with: {seed: 3, std: 1.0}}
  pid: {use: blocks.PID, with: {kp: 2.0, ki: 1.0, unit: 1/s}, in: {setpoint: r.y, measured: d.y}}
  x: {use: blocks.Integrator, in: {u: pid.u}}
  d: {use: blocks.Delay, with: {samples: 2}, in: {u: x.y}}
"""


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> aloft.Graph:
    path = tmp_path_factory.mktemp("branching") / "graph.yaml"
    path.write_text(TEXT)
    return aloft.load(path)


@pytest.fixture(scope="module")
def recorded(graph: aloft.Graph, tmp_path_factory: pytest.TempPathFactory) -> OpenedRun:
    path = tmp_path_factory.mktemp("branching") / "run.rrd"
    graph.run(1.5, sinks=[Recorder(path, keyframe_period=0.5)])
    return OpenedRun.of(path)


@pytest.mark.parametrize("tick", [30, 50, 73])
def test_without_a_change_it_has_the_bytes_of_the_recording_and_goes_on(
    graph: aloft.Graph, recorded: OpenedRun, tick: int
) -> None:
    done = branch(recorded, tick)
    assert done.identical
    assert (done.first_tick, done.signals.compared) == (tick, 150 - tick)
    assert done.ticks.tolist() == list(range(tick, 300))  # beyond the recording, as the graph says
    whole = graph.run()
    x = recorded.bus.view(done.rows, "x.y.value")
    assert np.array_equal(x, whole.signal("x.y.value")[tick:])


def test_with_a_change_it_is_a_run_that_was_changed_in_that_tick(
    graph: aloft.Graph, recorded: OpenedRun
) -> None:
    done = branch(recorded, 73, recorded.changed(["pid.kp=3.0"]), until=200)
    assert done.first is not None
    assert (done.first.tick, done.first.block) == (73, "pid")
    with graph.open() as before, graph.changed({"pid.kp": 3.0}).open() as after:
        before.step(73)
        after.restore(before.snapshot())
        expected = []
        for _ in range(73, 200):
            after.step()
            expected.append(after["x.y.value"])
    assert np.array_equal(recorded.bus.view(done.rows, "x.y.value"), np.array(expected))


def test_what_cannot_go_on_is_said(recorded: OpenedRun) -> None:
    with pytest.raises(
        ReplayError, match="tick 150 lies not within the recording: it has 0 to 149"
    ):
        branch(recorded, 150)
    longer = recorded.changed(["d.samples=5"])
    with pytest.raises(ReplayError, match=r"does not fit this graph: state d.x.values"):
        branch(recorded, 73, longer)
