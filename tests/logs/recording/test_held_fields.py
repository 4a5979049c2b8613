"""Large fields of slow blocks: recorded where the blocks ran, read back at every tick, to the byte."""

from pathlib import Path

import numpy as np
import pytest

from aloft.logs import RecordingError, read
from aloft.logs.file import packed_rows
from aloft.logs.file.held_fields import split_bus
from aloft.logs.file.records import Content
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.writer import write_recording
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay
from aloft.runtime.graph import load
from aloft.runtime.language.stages import RecordingSpec
from aloft.runtime.running.run_result import RunResult

MODULE = """\
from aloft import Block, Field, Output, Signal

class Picture(Signal):
    pixels = Field((32, 32), text="grey values")
    number = Field(dtype="int64", text="of the picture")

class Camera(Block):
    picture = Output(Picture, text="the picture")
    def step(self):
        self.picture.pixels[:] = self.tick
        self.picture.pixels[self.tick % 32, :] = 0.5
        self.picture.number[()] = self.tick
"""
GRAPH = """\
rate: 500 Hz
duration: 0.4 s
blocks:
  cam: {use: "cam_of_test:Camera", rate: 25 Hz, offset: 4}
  slow: {use: "cam_of_test:Camera", rate: 50 Hz}
  t: {use: blocks.Ramp, with: {slope: 1, unit: ""}}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunResult]:
    folder = tmp_path_factory.mktemp("held")
    (folder / "cam_of_test.py").write_text(MODULE)
    (folder / "cam.yaml").write_text(GRAPH)
    recorder = Recorder(folder / "a.rrd", keyframe_period=0.1)
    result = load(folder / "cam.yaml").run(sinks=[recorder])
    assert not recorder.warnings
    return folder, result


def test_every_tick_is_read_back_to_the_byte(made: tuple[Path, RunResult]) -> None:
    folder, result = made
    run = read(folder / "a.rrd")
    assert result.log is not None
    rows = result.log.rows()
    assert run.rows.tobytes() == rows.tobytes()
    split = split_bus(run.header)
    assert [(p.period, p.offset) for p in split.held] == [(20, 4), (10, 0)]
    assert run["cam.picture.pixels"].shape == (200, 32, 32)
    ticks, pictures = run.samples("cam.picture.pixels")
    assert ticks.tolist() == [0, *range(4, 200, 20)]
    np.testing.assert_array_equal(pictures, run["cam.picture.pixels"][ticks])
    at, some = run.window(33, 57)
    assert at.tolist() == list(range(33, 57)) and some.tobytes() == rows[33:57].tobytes()
    kept = sum(len(run.samples(f"{block}.picture.pixels")[0]) for block in ("cam", "slow"))
    assert kept == 11 + 20


def test_a_whole_run_written_at_once_is_the_same(made: tuple[Path, RunResult]) -> None:
    folder, result = made
    write_recording(folder / "b.rrd", result)
    assert read(folder / "b.rrd").rows.tobytes() == read(folder / "a.rrd").rows.tobytes()


def test_it_is_replayed(made: tuple[Path, RunResult]) -> None:
    done = replay(OpenedRun.of(made[0] / "a.rrd"), first_tick=60)
    assert done.identical and done.signals.compared == 150


def test_a_run_in_several_files(made: tuple[Path, RunResult]) -> None:
    folder, result = made
    recorder = Recorder(folder / "c.rrd", keyframe_period=0.05, split=0.15)
    load(folder / "cam.yaml").run(sinks=[recorder])
    rows = np.concatenate([read(file).rows for file in recorder.files])
    assert len(recorder.files) == 3 and result.log is not None
    assert rows.tobytes() == result.log.rows().tobytes()


def test_where_a_held_row_is_lost_its_ticks_are(
    made: tuple[Path, RunResult], tmp_path: Path
) -> None:
    folder, result = made
    run = read(folder / "a.rrd")
    record = run.scan.of(Content.HELD)[0]
    data = bytearray((folder / "a.rrd").read_bytes())
    data[record.place + 100] ^= 1
    (tmp_path / "a.rrd").write_bytes(data)
    with pytest.raises(
        RecordingError, match=r"of the ticks, those from the first tick to .* may be lost"
    ):
        read(tmp_path / "a.rrd")
    rest = read(tmp_path / "a.rrd", damaged=True)
    assert 0 < len(rest.ticks) < 200 and result.log is not None
    assert rest.rows.tobytes() == result.log.rows()[rest.ticks].tobytes()


def test_what_unpacks_to_too_much_is_told(
    made: tuple[Path, RunResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(packed_rows, "MOST_KEPT", 1 << 20)
    monkeypatch.setattr(packed_rows, "LIKELY_RATIO", 1)
    run = read(made[0] / "a.rrd")
    with pytest.raises(RecordingError, match=r"would unpack to \d+, more than is unpacked at once"):
        _ = run.rows
    assert len(run.window(0, 10)[0]) == 10


def test_the_ring_is_bounded_in_bytes(made: tuple[Path, RunResult]) -> None:
    recorder = Recorder(made[0] / "d.rrd", ring_bytes=1 << 16)
    load(made[0] / "cam.yaml").run(sinks=[recorder])
    assert recorder.link is not None and not recorder.dropped
    frame = 4 * (2 * 32 * 32 * 8 + 1024)
    assert recorder.link.ring.capacity < (1 << 16) + 2 * frame
    text = f"recording: {{ring_bytes: {1 << 17}}}\n" + (made[0] / "cam.yaml").read_text()
    (made[0] / "small.yaml").write_text(text)
    said = Recorder(made[0] / "e.rrd")
    load(made[0] / "small.yaml").run(sinks=[said])
    assert said.link is not None
    assert abs(said.link.ring.capacity - recorder.link.ring.capacity - (1 << 16)) <= 64
    assert RecordingSpec().ring_bytes == 64 << 20
