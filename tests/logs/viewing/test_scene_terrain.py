"""The ground in a recording: kept in its header, drawn in its scene."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aloft import load
from aloft.logs.file.format import Header
from aloft.logs.file.header import header_of
from aloft.logs.file.reader import read
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.language.terrain import Ground, Terrain
from aloft.runtime.running.memory import BoundGraph

GRAPHS = Path(__file__).parents[3] / "graphs"


def boxes_of(path: Path) -> Any:
    from rerun.chunk import RrdReader

    chunks = RrdReader(path).stream().filter(content="/world/ground")
    return [chunk.to_record_batch() for chunk in chunks]


def written(tmp_path: Path, header: Header) -> Path:
    path = tmp_path / "run.rrd"
    RecordingWriter(path, header).close()
    return path


def test_a_step_is_drawn(tmp_path: Path) -> None:
    header = header_of(BoundGraph(load(GRAPHS / "up_5cm.yaml").checked))
    assert header.terrain is not None and header.terrain.blocks[0].most[2] == 0.05
    path = written(tmp_path, header)
    assert read(path).header.terrain == header.terrain
    (batch,) = boxes_of(path)
    centre = np.array(batch["Boxes3D:centers"].to_pylist()[0])
    half = np.array(batch["Boxes3D:half_sizes"].to_pylist()[0])
    block = header.terrain.blocks[0]
    np.testing.assert_allclose(centre - half, [block.least], atol=1e-6)
    np.testing.assert_allclose(centre + half, [block.most], atol=1e-6)


def test_a_platform_has_a_floor_below_it(tmp_path: Path) -> None:
    header = header_of(BoundGraph(load(GRAPHS / "jump.yaml").checked))
    platform = Terrain(-0.35, (Ground((-0.5, -0.4, -0.35), (0.1, 0.4, 0.0)),))
    (batch,) = boxes_of(written(tmp_path, replace(header, terrain=platform)))
    assert len(batch["Boxes3D:centers"].to_pylist()[0]) == 2


def test_level_ground_is_the_viewers_grid(tmp_path: Path) -> None:
    header = header_of(BoundGraph(load(GRAPHS / "jump.yaml").checked))
    assert header.terrain == Terrain()
    assert boxes_of(written(tmp_path, header)) == []


def test_plots_show_every_value(tmp_path: Path) -> None:
    # a mean over neighbouring values halves the peak of a touchdown and draws force into the flight
    from rerun.chunk import RrdReader

    path = written(tmp_path, header_of(BoundGraph(load(GRAPHS / "jump.yaml").checked)))
    policies = {}
    for chunk in RrdReader(path).stream().filter(content="/**"):
        batch = chunk.to_record_batch()
        if "SeriesLines:aggregation_policy" in batch.schema.names:
            (found,) = batch["SeriesLines:aggregation_policy"].to_pylist()
            policies[str(chunk.entity_path)] = found
    assert set(map(tuple, policies.values())) == {(1,)}  # AggregationPolicy.Off
    assert {"/signals/robot/truth/com", "/plots/foot_force"} <= set(policies)
