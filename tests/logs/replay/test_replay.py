"""Runs executed again: the same bytes, or the first that differs by its name."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.integrators_and_delays import UnitDelay
from aloft.blocks.general.sources import SineWave
from aloft.blocks.general.vectors import Vector
from aloft.logs.replay.replay import (
    KeptRun,
    Keyframes,
    ReplayError,
    RowCursor,
    default_inputs,
    nearest_keyframe,
    replay,
)
from aloft.runtime.language.block import Block, Output, State
from aloft.runtime.language.errors import BlockError
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing import BlockUse, checked_graph


class Noise(Block):
    """A robot of sorts: what it says comes from outside."""

    class Params(Parameters):
        n: int = parameter(2, text="elements")
        seed: int = parameter(0, text="of the noise")

    params: Params
    outside = "simulated"
    y = Output(Vector, text="noise")
    x = State(Vector, text="the generator's place")

    def setup(self) -> None:
        self._noise = np.random.default_rng(self.params.seed).standard_normal((1000, 2))

    def emit(self) -> None:
        self.y.value[...] = self._noise[int(self.x.value[0])]

    def update(self) -> None:
        self.x.value += 1.0


class RealNoise(Noise):
    """A robot that never says the same twice, and cannot be opened here."""

    outside = "real"

    def start(self) -> None:
        raise BlockError("no such port")


class OneUlp(Gain):
    """A gain that from tick 700 on is wrong by one unit in the last place, in one element."""

    def step(self) -> None:
        super().step()
        if self.tick >= 700:
            self.y.value[1] = math.nextafter(float(self.y.value[1]), math.inf)


class Remembering(Gain):
    """A gain with a state that the recorded one has not."""

    last = State(Vector, text="the last input")

    def step(self) -> None:
        super().step()
        self.last.value[...] = self.u.value


class Spoilt(Gain):
    """A gain that gives no number."""

    def step(self) -> None:
        super().step()
        if self.tick == 612:
            self.y.value[0] = math.nan


class Failing(Gain):
    """A gain that breaks."""

    def step(self) -> None:
        if self.tick == 612:
            raise BlockError("the spring broke")
        super().step()


def graph(kind: type[Gain] = Gain, robot: type[Noise] = Noise, factor: float = 3.0) -> CheckedGraph:
    return checked_graph(
        {
            "late": BlockUse(UnitDelay, {"n": 2}, {"u": "gain.y"}),
            "robot": BlockUse(robot),
            "gain": BlockUse(kind, {"n": 2, "gain": factor}, {"u": "robot.y"}),
            "slow": BlockUse(SineWave, {"n": 1}, period_ticks=5),
        },
        ticks=900,
    )


class Change(Sink):
    """A sink that changes parameters while the graph runs."""

    def __init__(self, changes: Mapping[int, Mapping[str, Any]]) -> None:
        self.changes = changes

    def open(self, bound: BoundGraph) -> None:
        self.bound = bound

    def record(self, tick: int) -> None:
        if tick + 1 in self.changes:
            self.bound.parameters.requests.append(adjust(self.bound.blocks, self.changes[tick + 1]))


def record(checked: CheckedGraph, changes: Mapping[int, Mapping[str, Any]] = {}) -> KeptRun:
    keyframes = Keyframes(250)
    result = Executor(checked, sinks=[keyframes, Change(changes)]).run()
    return KeptRun.of(result, keyframes)


@pytest.fixture(scope="module")
def recorded() -> KeptRun:
    return record(graph())


def test_the_same_again(recorded: KeptRun) -> None:
    for inputs in (None, "seed", "recorded"):
        done = replay(recorded, inputs=inputs)  # type: ignore[arg-type]
        assert done.identical and done.first_tick == 0
        assert done.signals.compared == 900 and done.states.compared == 3
        assert ("robot" in done.ran) == (inputs != "recorded")


def test_one_ulp_is_found_and_named(recorded: KeptRun) -> None:
    done = replay(recorded, graph=graph(OneUlp))
    assert done.first is not None and not done.identical
    assert (done.first.tick, done.first.block, done.first.name) == (700, "gain", "gain.y.value")
    assert (done.first.element, done.first.ulps) == ((1,), 1)
    assert str(done.first).startswith("tick 700: block 'gain': gain.y.value[1] was ")
    assert str(done.first).endswith(", 1 ULP apart")
    assert done.signals.fields["gain.y.value"].elements == 200
    # the delay runs first in the tick, but saw it one tick later
    assert done.signals.fields["late.y.value"].first.tick == 701
    assert done.states.first is not None and done.states.first.tick == 750
    alone = replay(recorded, graph=graph(OneUlp), run=["gain"])
    assert alone.first == done.first and list(alone.signals.fields) == ["gain.y.value"]


def test_from_a_keyframe_byte_for_byte_as_from_the_beginning(recorded: KeptRun) -> None:
    whole = replay(recorded, graph=graph(OneUlp), keep=True)
    part = replay(recorded, graph=graph(OneUlp), first_tick=749, keep=True, last_tick=800)
    assert part.first_tick == 500 and part.ticks[0] == 500 and part.ticks[-1] == 799
    assert part.rows.tobytes() == whole.rows[500:800].tobytes()
    assert part.first == whole.first


def test_a_simulation_with_another_seed_is_fed_or_differs(recorded: KeptRun) -> None:
    other = checked_graph(
        {"late": BlockUse(UnitDelay, {"n": 2}, {"u": "gain.y"}), "robot": BlockUse(Noise, {"seed": 1}),
         "gain": BlockUse(Gain, {"n": 2, "gain": 3.0}, {"u": "robot.y"}),
         "slow": BlockUse(SineWave, {"n": 1}, period_ticks=5)}, ticks=900,
    )  # fmt: skip
    first = replay(recorded, graph=other).first
    assert first is not None and (first.tick, first.block) == (0, "robot")
    assert replay(recorded, graph=other, inputs="recorded").identical


def test_a_real_robot_is_never_opened(recorded: KeptRun) -> None:
    real = graph(robot=RealNoise)
    assert default_inputs(real) == "recorded" and default_inputs(graph()) == "seed"
    assert replay(recorded, graph=real).identical
    assert replay(recorded, graph=real, inputs="seed").identical  # nor where everything is to run
    with pytest.raises(ReplayError, match=r"robot .* acts outside of the graph"):
        replay(recorded, graph=real, run=["robot"])


class Publisher(Gain):
    """A block that tells others."""

    acts_outside = True

    def start(self) -> None:
        raise BlockError("it was started")


@pytest.mark.parametrize("inputs", ["seed", "recorded"])
def test_what_acts_outside_is_played(recorded: KeptRun, inputs: Any) -> None:
    silent = graph(Publisher)
    done = replay(recorded, graph=silent, inputs=inputs)
    assert done.identical and "gain" not in done.ran


def test_parameter_changes_are_part_of_the_run() -> None:
    changed = record(graph(), {300: {"gain.gain": 0.1}, 610: {"gain.gain": 7.5}})
    assert [(c.tick, c.new) for c in changed.changes] == [(300, 0.1), (610, 7.5)]
    for options in ({}, {"inputs": "recorded"}, {"first_tick": 620}, {"run": ["gain"]},
                    {"run": ["late"]}):  # fmt: skip
        done = replay(changed, **options)  # type: ignore[arg-type]
        assert done.identical, options
    from_keyframe = replay(changed, first_tick=620)
    assert from_keyframe.first_tick == 500
    assert from_keyframe.result.parameter_changes[-1].tick == 610
    without = KeptRun(**{**vars(changed), "changes": ()})
    first = replay(without).first
    assert first is not None and (first.tick, first.block) == (300, "gain")


def test_a_changed_block_beside_the_recorded_one(recorded: KeptRun) -> None:
    done = replay(recorded, graph=graph(factor=4.0), run=["gain"], keep=True)
    assert done.ran == ("gain",)
    (name, worst), *rest = done.signals.largest()
    assert name == "gain.y.value" and not rest
    values = recorded.bus.view(recorded.all_rows, "robot.y.value")
    expected = np.abs(4.0 * values - 3.0 * values)
    assert worst.largest == expected.max()
    assert worst.largest_tick == int(expected.max(axis=1).argmax())
    assert worst.ticks == 900 and worst.elements == 1800
    assert len(done.rows) == len(done.ticks) == 900


def test_a_block_with_other_state(recorded: KeptRun) -> None:
    done = replay(recorded, graph=graph(Remembering), run=["gain"])
    assert done.first is None and done.notes == ("gain.last.value is new",)
    with pytest.raises(ReplayError, match=r"does not fit this graph: state gain\.last\.value"):
        replay(recorded, graph=graph(Remembering), run=["gain"], first_tick=600)


def test_a_run_that_failed_fails_again() -> None:
    failed = record(graph(Failing))
    assert failed.failed and failed.ticks[-1] == 611
    done = replay(failed)
    assert done.identical
    assert done.result.reason == "block 'gain' failed at tick 612 (1.224 s): the spring broke"
    mended = replay(failed, graph=graph())
    assert mended.identical and mended.result.success


def test_a_run_that_ended_with_a_value_that_is_not_finite() -> None:
    failed = record(graph(Spoilt))
    assert failed.ticks[-1] == 612 and not failed.failed  # the last row holds that value
    done = replay(failed)
    assert done.identical and "wrote a value that is not finite" in done.result.reason
    mended = replay(failed, graph=graph())
    assert mended.first is not None and math.isnan(mended.first.recorded)
    assert mended.first.ulps is None


def test_a_replay_that_ends_early(recorded: KeptRun) -> None:
    done = replay(recorded, graph=graph(Failing))
    assert done.first is None and not done.identical
    assert done.notes[0].startswith("it ended after 612 of 900 ticks: block 'gain' failed")


def test_missing_ticks() -> None:
    whole = record(graph())
    kept = np.flatnonzero((whole.ticks < 400) | (whole.ticks >= 420))
    gap = KeptRun(**{**vars(whole), "ticks": whole.ticks[kept], "all_rows": whole.all_rows[kept]})
    done = replay(gap)
    assert done.identical and done.signals.compared == 880
    with pytest.raises(ReplayError, match=r"ticks 400 to 419 were not recorded.*--from-tick 420"):
        replay(gap, inputs="recorded")
    assert replay(gap, inputs="recorded", first_tick=500).identical
    late = KeptRun(**{**vars(whole), "ticks": whole.ticks[300:], "all_rows": whole.all_rows[300:]})
    with pytest.raises(ReplayError, match=r"begins at tick 300.*--from: 250, 500, 750"):
        replay(late)


def test_what_cannot_be_replayed(recorded: KeptRun) -> None:
    with pytest.raises(ReplayError, match="there is no block 'gian'; there is late, robot"):
        replay(recorded, run=["gian"])
    with pytest.raises(ReplayError, match="tick 900 is not in the recording, which has 0 to 899"):
        replay(recorded, first_tick=900)
    with pytest.raises(ReplayError, match="no tick from 500 up to 400"):
        replay(recorded, first_tick=500, last_tick=400)
    other = checked_graph({"new": BlockUse(SineWave), "gain": BlockUse(Gain, {}, {"u": "new.y"})})
    with pytest.raises(ReplayError, match=r"new\.y\.value is not in the recording"):
        replay(recorded, graph=other, run=["gain"])


def test_rows_and_keyframes(recorded: KeptRun) -> None:
    assert [nearest_keyframe(recorded, t) for t in (0, 249, 250, 899)] == [None, None, 250, 750]
    cursor = RowCursor(recorded)
    for tick in (0, 1, 600, 3, 899):
        row = cursor.at(tick)
        assert row is not None and row.tobytes() == recorded.all_rows[tick].tobytes()
    assert cursor.at(900) is None
