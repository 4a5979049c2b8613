"""Recordings read back: bit for bit, by name, with units; and what is no recording."""

from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft import load
from aloft.logs import RecordingError, read
from aloft.logs.file.format import FORMAT, Header
from aloft.logs.file.header import header_of
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.writer import RecordingWriter
from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.parameter_change import ParameterChange
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Note, parameter_note
from aloft.runtime.running.snapshot import Snapshot
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Odd(Signal):
    """Numbers that are easily lost."""

    reals = Field((2, 2), unit="rad/s", frame="body", text="four numbers")
    integer = Field(dtype="int64")
    switches = Field(3, dtype="bool")


class Source(Block):
    """Nothing but ports: the test writes the bus itself."""

    u = Input(Odd, default={"reals": 0.25, "integer": 2**60 + 1})
    y = Output(Odd)
    memory = State(Odd)

    def step(self) -> None:
        """Nothing."""


@pytest.fixture
def bound() -> BoundGraph:
    return BoundGraph(checked_graph({"a/b": BlockUse(Source)}, ticks=10))


def rows_of(bound: BoundGraph, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    found = []
    for _ in range(count):
        signal = bound.blocks["a/b"].y
        signal.reals[...] = rng.standard_normal((2, 2)) * 10.0 ** rng.integers(-300, 300)
        signal.reals[0, 0] = -0.0
        signal.integer[...] = rng.integers(-(2**63), 2**63 - 1)
        signal.switches[...] = rng.integers(0, 2, 3)
        found.append(bound.memory.bus.buffer.copy())
    return np.array(found)


def test_everything_comes_back_as_it_was(bound: BoundGraph, tmp_path: Path) -> None:
    header = header_of(bound)
    ticks = np.array([0, 1, 2, 5, 6])  # two were dropped
    rows = rows_of(bound, len(ticks))
    rows[-1, :8] = np.array([np.nan]).view(np.uint8)  # a run that failed ends like this
    writer = RecordingWriter(tmp_path / "a.rrd", header)
    notes = [
        Note(0, "life", "running"),
        parameter_note(ParameterChange(2, "a/b.gain", 1.0, [2.0])),
        Note(3, "dropped", "2 ticks", "WARN", {"first": 3, "last": 4, "count": 2}),
    ]
    keyframe = Snapshot(5, rows[2].tobytes(), bytes(range(64)) * (header.state.size // 64))
    writer.write_rows(ticks[:2], rows[:2])
    for note in notes:
        writer.write_notes([note])
    writer.write_keyframe(keyframe)
    writer.write_rows(ticks[2:], rows[2:])
    half = read(tmp_path / "a.part.rrd")  # while it is being written
    assert half.outcome is None
    assert half.rows.tobytes() == rows.tobytes()
    writer.write_outcome({"success": True, "run_hash": "abc"})
    writer.close()

    run = read(tmp_path / "a.rrd")
    assert run.header == header
    assert run.outcome == {"success": True, "run_hash": "abc"}
    assert run.ticks.tolist() == ticks.tolist()
    np.testing.assert_array_equal(run.time, ticks / header.base_rate)
    layout = bound.memory.bus.layout
    for name in ("reals", "integer", "switches"):  # one by one, before rows are read
        expected = layout.view(rows, f"a/b.y.{name}")
        assert run[f"a/b.y.{name}"].dtype == expected.dtype
        assert run[f"a/b.y.{name}"].tobytes() == expected.tobytes(), name
    assert run.rows.tobytes() == rows.tobytes()
    assert run["a/b.y.integer"].tolist() == layout.view(rows, "a/b.y.integer").tolist()
    assert run.notes == tuple(notes)
    assert run.parameter_changes == (ParameterChange(2, "a/b.gain", 1.0, [2.0]),)
    assert run.dropped_ticks == 2
    assert run.keyframes == (5,)
    assert run.snapshot(5) == keyframe
    bound.restore(run.snapshot(5))


def test_signals_are_described_without_their_code(bound: BoundGraph, tmp_path: Path) -> None:
    header = Header.from_json(header_of(bound).to_json())
    fields = {field.name: field for field in header.bus.fields}
    assert list(fields) == [f"a/b.{p}.{n}" for p in "yu" for n in Odd.fields]
    reals = fields["a/b.y.reals"]
    assert (reals.unit, reals.frame, reals.text) == ("rad/s", "body", "four numbers")
    assert fields["a/b.u.reals"].constant
    assert header.bus.layout() == bound.memory.bus.layout
    assert header.state.layout() == bound.memory.state.layout
    assert header.blocks[0].type.endswith(":Source")
    other = BoundGraph(checked_graph({"a/c": BlockUse(Source)}))
    assert header_of(other).schema_hashes != header.schema_hashes
    RecordingWriter(tmp_path / "a.rrd", header).close()
    run = read(tmp_path / "a.rrd")
    assert list(run.signals()) == [f"a/b.y.{name}" for name in Odd.fields]
    assert run["a/b.y.reals"].shape == (0, 2, 2)
    assert run.rows.shape == (0, header.bus.size)
    with pytest.raises(KeyError, match=r"no signal 'a/b.reals'; the nearest are a/b.y.reals"):
        run["a/b.reals"]


def test_a_port_of_one_field_stands_for_its_field(tmp_path: Path) -> None:
    graph = load("rate: 10 Hz\nduration: 1 s\nblocks:\n  wave: {use: blocks.SineWave}\n")
    result = graph.run(sinks=[Recorder(tmp_path / "a.rrd")])
    recorded = read(tmp_path / "a.rrd")
    assert np.array_equal(recorded["wave.y"], recorded["wave.y.value"])
    assert np.array_equal(result.signal("wave.y"), recorded["wave.y"])


def test_what_is_no_recording_is_said_so(tmp_path: Path) -> None:
    import rerun as rr

    with pytest.raises(FileNotFoundError):
        read(tmp_path / "none.rrd")
    (tmp_path / "text.rrd").write_text("hello")
    with pytest.raises(RecordingError, match=r"text.rrd is not a recording: it does not begin"):
        read(tmp_path / "text.rrd")
    stream = rr.RecordingStream("other", send_properties=False)
    stream.save(tmp_path / "other.rrd")
    stream.log("a", rr.TextDocument("b"), static=True)
    stream.disconnect()
    with pytest.raises(RecordingError, match="not a recording of a run by aloft"):
        read(tmp_path / "other.rrd")


@pytest.mark.parametrize("number, what", [(99, "update aloft to "), (3, "read it with aloft ")])
def test_another_format_is_refused(
    bound: BoundGraph, tmp_path: Path, number: int, what: str
) -> None:
    from dataclasses import replace

    header = replace(header_of(bound), format=number)
    RecordingWriter(tmp_path / "a.rrd", header).close()
    match = f"has format {number}, this version of aloft reads {FORMAT}; {what}{aloft.__version__}"
    with pytest.raises(RecordingError, match=match):
        read(tmp_path / "a.rrd")
