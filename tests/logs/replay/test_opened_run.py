"""A recording file replayed: keyframes, live changes and failures come out of the file."""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.logs.file import packed_rows
from aloft.logs.file.code import code_of, remember
from aloft.logs.file.header import machine, make_header
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.writer import RecordingWriter
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import Keyframes, replay
from aloft.runtime.graph import load
from aloft.runtime.language.errors import AloftError
from aloft.runtime.loading import checked_file
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.running.sink import Sink, parameter_note

GRAPH = """
rate: 200 Hz
duration: 2 s
blocks:
  wave: {use: blocks.SineWave, with: {n: 2, frequency: 3.0}}
  gain: {use: "parts:Fragile", with: {n: 2, gain: 1.5}, in: {u: {from: wave.y, delay: 2}}}
  total: {use: blocks.Integrator, with: {n: 2}, in: {u: gain.y}, rate: 100 Hz}
"""
PARTS = """
from aloft import BlockError, parameter
from aloft.blocks.general import arithmetic


class Fragile(arithmetic.Gain):
    '''A gain that breaks at a tick.'''

    class Params(arithmetic.Gain.Params):
        breaks: int = parameter(-1, text="when")

    def step(self) -> None:
        if self.tick == self.params.breaks:
            raise BlockError("broken")
        super().step()
"""


class Tune(Sink):
    """A sink that changes the gain twice, once in the tick of a keyframe."""

    def open(self, bound: BoundGraph) -> None:
        self.bound = bound

    def record(self, tick: int) -> None:
        if tick in (139, 199):
            value = 0.1 if tick == 139 else 1 / 3
            self.bound.parameters.requests.append(adjust(self.bound.blocks, {"gain.gain": value}))


def record(folder: Path, **settings: Any) -> RunResult:
    (folder / "sum.yaml").write_text(GRAPH)
    (folder / "parts.py").write_text(PARTS)
    graph = checked_file(
        folder / "sum.yaml", {f"gain.{key}": value for key, value in settings.items()}
    )
    keyframes = Keyframes(100)
    result = Executor(graph, sinks=[keyframes, Tune()]).run()
    log = result.log
    assert log is not None and log.layout is not None
    rows = log.rows()
    header = make_header(graph, log.layout, rows[0].tobytes(), state=keyframes.layout)
    writer = RecordingWriter(folder / "recordings" / "sum.rrd", header)
    writer.write_rows(np.array(log.ticks, np.int64), rows)
    for snapshot in keyframes.snapshots.values():
        writer.write_keyframe(snapshot)
    for change in result.parameter_changes:
        writer.write_notes([parameter_note(change)])
    writer.write_outcome(result.to_json())
    writer.close()
    assert graph.resolved is not None
    remember(code_of(graph.resolved))  # as a recorder does
    return result


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RunResult]:
    """A folder with a graph and its recording, made by naming the graph as seen from there."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return folder, record(Path())


@pytest.fixture(scope="module")
def opened(made: tuple[Path, RunResult]) -> OpenedRun:
    return OpenedRun.of(made[0] / "recordings" / "sum.rrd")


def test_keyframes_and_live_changes(made: tuple[Path, RunResult], opened: OpenedRun) -> None:
    _, result = made
    assert [c.tick for c in result.parameter_changes] == [140, 200]
    assert opened.changes == result.parameter_changes
    assert list(opened.keyframes) == [100, 200, 300, 400] and not opened.failed
    whole = replay(opened, keep=True)
    assert whole.identical and whole.states.compared == 4
    assert whole.result.run_hash == result.run_hash
    for first in (150, 200, 250, 399):
        part = replay(opened, first_tick=first, keep=True)
        assert part.identical
        assert part.rows.tobytes() == whole.rows[part.first_tick :].tobytes()
    assert replay(opened, run=["total"], first_tick=250).identical
    assert opened.changed_dependencies() == []


def test_a_failure_happens_again(tmp_path: Path) -> None:
    result = record(tmp_path, breaks=333)
    assert result.error is not None
    opened = OpenedRun.of(tmp_path / "recordings" / "sum.rrd")
    assert opened.failed and opened.ticks[-1] == 332
    done = replay(opened)
    assert done.identical and done.result.reason == result.reason


def test_where_the_graphs_own_files_are(
    made: tuple[Path, RunResult], opened: OpenedRun, tmp_path: Path
) -> None:
    folder, _ = made
    assert opened.file.header.source == "sum.yaml"
    assert opened.folder == folder  # the folder above the recording's
    moved = tmp_path / "sum.rrd"
    shutil.copy(opened.file.path, moved)
    assert OpenedRun.of(moved).folder == Path()
    assert OpenedRun.of(moved, folder).graph.name == "sum"
    (tmp_path / "no.rrd").write_bytes(b"RRF2")
    with pytest.raises(AloftError, match="is not a recording: Rerun cannot read it"):
        OpenedRun.of(tmp_path / "no.rrd")


def test_other_versions_are_named(opened: OpenedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aloft.logs.replay.opened_run.versions", lambda: {"numpy": "0.1"})
    other = opened.changed_dependencies()
    assert any(line.startswith("numpy was ") and line.endswith(" and is 0.1") for line in other)
    assert any(line.startswith("python was ") and "not installed" in line for line in other)


def test_another_c_library_is_named(opened: OpenedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = machine()["C library"]
    assert ours
    monkeypatch.setattr("platform.libc_ver", lambda: ("glibc", "2.5"))
    assert opened.changed_dependencies() == [f"C library was {ours} and is glibc 2.5"]


@pytest.mark.long
@pytest.mark.skipif(platform.machine() != "x86_64", reason="names kernels of x86-64 processors")
def test_another_kernel_of_blas_is_named(made: tuple[Path, RunResult]) -> None:
    """With other routines BLAS rounds otherwise, which a replay must be able to say."""
    program = (
        "from aloft.logs.replay.opened_run import OpenedRun\n"
        "print(*OpenedRun.of('recordings/sum.rrd').changed_dependencies(), sep='\\n')\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", program],
        cwd=made[0],
        env={**os.environ, "OPENBLAS_CORETYPE": "Nehalem"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    ours = machine()["blas kernel"]
    assert said.splitlines() == [f"blas kernel was {ours} and is Nehalem"]


def test_only_the_rows_from_the_keyframe_on_are_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last minute of a long run costs what a minute costs."""
    path = tmp_path / "long.rrd"
    text = "rate: 100 Hz\nduration: 40 s\nblocks:\n  w: {use: blocks.SineWave, with: {n: 2}}\n"
    assert load(text).run(sinks=[Recorder(path)], log=False).success
    unpacked: list[int] = []
    unpack = packed_rows.unpack

    def counted(data: bytes) -> Any:
        first, rows = unpack(data)
        unpacked.append(len(rows))
        return first, rows

    monkeypatch.setattr(packed_rows, "unpack", counted)
    done = replay(OpenedRun.of(path), first_tick=3700)
    assert done.identical
    assert sum(unpacked) < 300 + 2 * 512
