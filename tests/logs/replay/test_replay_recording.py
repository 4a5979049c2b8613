"""Recorded and replayed side by side in one file."""

from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.sources import SineWave
from aloft.logs.replay.replay import KeptRun, Keyframes, ReplayError, replay
from aloft.logs.replay.replay_recording import write_replay
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.running.executor import Executor
from aloft.runtime.testing import BlockUse, checked_graph


def graph(factor: float) -> CheckedGraph:
    wave = BlockUse(SineWave, {"n": 2, "frequency": 5.0})
    gain = BlockUse(Gain, {"n": 2, "gain": factor}, {"u": "wave.y"})
    return checked_graph({"wave": wave, "gain": gain}, ticks=300)


try:
    from rerun.chunk import RrdReader
except ImportError:  # Rerun 0.40
    from rerun.experimental import RrdReader


def test_both_are_in_the_file(tmp_path: Path) -> None:
    keyframes = Keyframes(100)
    recorded = KeptRun.of(Executor(graph(2.0), sinks=[keyframes]).run(), keyframes)
    done = replay(recorded, graph=graph(2.5), run=["gain"], keep=True, first_tick=150)
    path = write_replay(tmp_path / "new" / "both.rrd", recorded, done)
    found: dict[str, list[np.ndarray]] = {}
    ticks: dict[str, list[np.ndarray]] = {}
    for chunk in RrdReader(path).stream():
        entity, batch = str(chunk.entity_path), chunk.to_record_batch()
        if "Scalars:scalars" in batch.schema.names:
            values = batch["Scalars:scalars"].flatten().to_numpy().reshape(-1, 2)
            found.setdefault(entity, []).append(values)
            ticks.setdefault(entity, []).append(batch["tick"].to_numpy())
    assert sorted(found) == ["/recorded/gain/y/value", "/replayed/gain/y/value"]
    was, now = (np.concatenate(found[name]) for name in sorted(found))
    np.testing.assert_array_equal(was, recorded.bus.view(recorded.all_rows, "gain.y.value")[100:])
    np.testing.assert_array_equal(now, was * 1.25)
    for each in ticks.values():
        np.testing.assert_array_equal(np.concatenate(each), np.arange(100, 300))


def test_without_rows(tmp_path: Path) -> None:
    keyframes = Keyframes(100)
    recorded = KeptRun.of(Executor(graph(2.0), sinks=[keyframes]).run(), keyframes)
    with pytest.raises(ReplayError, match="kept no tick; replay with keep=True"):
        write_replay(tmp_path / "both.rrd", recorded, replay(recorded))
