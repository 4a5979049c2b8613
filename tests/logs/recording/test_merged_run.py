"""The recordings of a run's parts become the recording that one process would have made."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.sources import Constant
from aloft.logs.file.reader import RecordedRun, read
from aloft.logs.recording.merged_run import (
    machine_of,
    merge_recordings,
    merged_outcome,
    read_parts,
    run_hash_of,
)
from aloft.logs.recording.recorder import Recorder
from aloft.runtime.language.errors import AloftError
from aloft.runtime.placement.placed import PlacedGraph, split_over_machines
from aloft.runtime.running.executor import run
from aloft.runtime.testing.graphs import BlockUse, checked_graph
from aloft.runtime.testing.spread import run_parts_of
from aloft.runtime.transports.hub import Hub

from ...runtime.links.example_graphs import ring

pytestmark = pytest.mark.long

Made = tuple[PlacedGraph, dict[str, Path], Path]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A graph, the recordings of its parts, and the recording of a run in one process."""
    folder = tmp_path_factory.mktemp("parts")
    placed = split_over_machines(ring(ticks=60))
    paths = {machine.name: folder / f"{machine.name}.rrd" for machine in placed.machines}
    run_parts_of(
        placed, Hub(),
        {name: [Recorder(path, keyframe_period=0.04)] for name, path in paths.items()},
    )  # fmt: skip
    run(placed.graph, sinks=[Recorder(folder / "alone.rrd", keyframe_period=0.04)])
    return placed, paths, folder / "alone.rrd"


def same(one: RecordedRun, other: RecordedRun) -> None:
    np.testing.assert_array_equal(one.ticks, other.ticks)
    np.testing.assert_array_equal(one.rows, other.rows)
    assert one.keyframes == other.keyframes
    for tick in one.keyframes:
        assert one.snapshot(tick) == other.snapshot(tick)


def test_the_merged_recording_is_that_of_one_process(made: Made, tmp_path: Path) -> None:
    placed, paths, alone = made
    parts = read_parts(placed, paths)
    expected = read(alone)
    assert expected.outcome is not None
    assert run_hash_of(placed, parts) == (expected.outcome["run_hash"], 60)
    target = tmp_path / "whole.rrd"
    assert merge_recordings(target, placed, parts, dict(expected.outcome)) == target
    merged = read(target)
    assert merged.whole
    same(merged, expected)
    assert len(merged.keyframes) == 3
    assert merged.header.bus == expected.header.bus
    assert [note.text for note in merged.notes] == [note.text for note in expected.notes]


def test_a_missing_part_is_named(made: Made) -> None:
    placed, paths, _ = made
    with pytest.raises(AloftError, match="the recordings of near are missing"):
        read_parts(placed, {name: path for name, path in paths.items() if name != "near"})


def test_a_recording_of_another_graph_is_refused(made: Made, tmp_path: Path) -> None:
    placed, paths, _ = made
    other = checked_graph({"c": BlockUse(Constant, {"value": [1.0]})}, ticks=3)
    run(other, sinks=[Recorder(tmp_path / "o.rrd")])
    with pytest.raises(
        AloftError, match=r"are not of one run of test: last\.y\.value is not in the part of far"
    ):
        read_parts(placed, {**paths, "far": tmp_path / "o.rrd"})


def test_parts_are_known_by_their_blocks(made: Made) -> None:
    placed, paths, alone = made
    for machine, path in paths.items():
        assert machine_of(placed, read(path)) == machine
    other = replace(placed, graph=replace(placed.graph, machines=placed.machines[:0]))
    with pytest.raises(AloftError, match="is not the recording of one part of test"):
        machine_of(other, read(alone))


def test_the_outcome_of_the_whole(made: Made) -> None:
    placed, paths, alone = made
    outcome = merged_outcome(placed, read_parts(placed, paths), "abc", 60)
    expected = read(alone).outcome
    assert expected is not None
    assert (outcome["run_hash"], outcome["ticks"]) == ("abc", 60)
    assert list(outcome["blocks"]) == list(expected["blocks"])
    for key in ("success", "reason", "exit_code", "metrics"):
        assert outcome[key] == expected[key], key
