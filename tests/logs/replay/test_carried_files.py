"""A replay has the files of the recorded run, also where they have changed or gone since."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from aloft.logs.file.code import code_of, remember
from aloft.logs.file.format import Header, RecordedLayout
from aloft.logs.file.header import header_of
from aloft.logs.file.reader import read
from aloft.logs.recording.writer import RecordingWriter
from aloft.logs.replay.opened_run import OpenedRun, restored
from aloft.logs.replay.replay import replay
from aloft.robots.description import find_robot, read_description, robot_names
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import checked_file, flattened_text
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph

GRAPH = """
rate: 100 Hz
duration: 0.2 s
blocks:
  table: {use: "parts:Table", with: {file: numbers.txt}}
  found: {use: "parts:Found"}
"""
PARTS = '''
from pathlib import Path

from aloft import Block, Field, Output, Parameters, Signal, parameter


class Number(Signal):
    value = Field()


class Table(Block):
    """Gives the numbers of a file, one in each tick."""

    y = Output(Number)

    class Params(Parameters):
        file: str = parameter(text="a file with a number in each line")

    def setup(self) -> None:
        lines = (self.context.folder / self.params.file).read_text().split()
        self.numbers = [float(line) for line in lines]

    def step(self) -> None:
        self.y.value[...] = self.numbers[self.tick % len(self.numbers)]


class Found(Block):
    """Gives the number in the first file of a folder."""

    y = Output(Number)
    files_folder = "place"

    class Params(Parameters):
        place: str = parameter("kept", text="a folder")

    def setup(self) -> None:
        (file,) = sorted((self.context.folder / self.params.place).glob("*.txt"))
        self.files_read = (file,)
        self.number = float(file.read_text())

    def step(self) -> None:
        self.y.value[...] = self.number
'''


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a graph, its block, two files that it reads, and a recording of its run."""
    (tmp_path / "graph.yaml").write_text(GRAPH)
    (tmp_path / "parts.py").write_text(PARTS)
    (tmp_path / "numbers.txt").write_text("1.5\n2.5\n3.25\n")
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "one.txt").write_text("7")
    monkeypatch.chdir(tmp_path)
    record(checked_file("graph.yaml"), tmp_path / "run.rrd")
    return tmp_path


def record(graph: CheckedGraph, path: Path) -> None:
    """Run a graph and write its recording."""
    bound = BoundGraph(graph)
    header = header_of(bound)
    result = Executor(bound, log=True).run()
    assert result.log is not None
    writer = RecordingWriter(path, header)
    writer.write_rows(np.array(result.log.ticks), result.log.rows())
    writer.write_outcome(result.to_json())
    writer.close()
    assert graph.resolved is not None
    remember(code_of(graph.resolved))  # as a recorder does


def test_unchanged_files_are_used_as_they_are(project: Path) -> None:
    opened = OpenedRun.of(project / "run.rrd")
    assert replay(opened).identical
    assert opened.restored.overrides.keys() == {"found.place"}  # only the block knows what it finds


@pytest.mark.parametrize("gone", [False, True])
def test_changed_files_are_taken_from_the_recording(project: Path, gone: bool) -> None:
    for file, text in (("numbers.txt", "8"), ("kept/one.txt", "9")):
        if gone:
            (project / file).unlink()
        else:
            (project / file).write_text(text)
    opened = OpenedRun.of(project / "run.rrd")
    assert replay(opened).identical
    why = "is not there any more" if gone else "has other content now"
    assert opened.restored.said == (
        f"the file of table.file: numbers.txt {why}; the recorded one is used",
        "the file one.txt of found is taken from the recording",
    )
    assert opened.changed_dependencies() == []


def test_without_restoring_the_present_files_are_used(project: Path) -> None:
    (project / "numbers.txt").write_text("8")
    opened = OpenedRun.of(project / "run.rrd", restore=False)
    done = replay(opened)
    assert done.first is not None and done.first.tick == 0
    assert opened.changed_dependencies() == [
        "the file of table.file: numbers.txt has other content"
    ]


def test_a_large_file_is_named_and_not_carried(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aloft.logs.file.dependencies.MOST_CARRIED", 4)
    record(checked_file("graph.yaml"), project / "large.rrd")
    header = read(project / "large.rrd").header
    assert len(header.files) == 2
    assert header.contents == {}


@pytest.mark.parametrize("name", robot_names())
def test_a_robot_is_restored_where_it_is_another(name: str, tmp_path: Path) -> None:
    robot = find_robot(name)
    other = robot.model_copy(update={"text": "as it was then"})
    nothing = RecordedLayout((), {}, {}, 0)
    text = f"rate: 500 Hz\nrobot: {name}\nblocks: {{}}\n"
    header = Header("graph", text, 500.0, nothing, nothing, b"", robot=other)
    found = restored(header, flattened_text(text, "graph.yaml"), tmp_path)
    (said,) = found.said
    assert said == (
        f"the description of the robot {name} is not the recorded one any more, or is not there; "
        "the recorded one is used"
    )
    written = found.overrides["robot"]
    again = read_description(Path(written))
    assert again.model_dump(mode="json") == other.model_dump(mode="json")

    same = Header("graph", text, 500.0, nothing, nothing, b"", robot=robot)
    assert restored(same, flattened_text(text, "graph.yaml"), tmp_path).overrides == {}


def test_a_jump_is_replayed_with_its_recorded_plan(tmp_path: Path) -> None:
    graphs = Path(__file__).parents[3] / "graphs"
    for folder in ("tasks", "controllers", "trials"):
        shutil.copytree(graphs / folder, tmp_path / folder)
    (tmp_path / "jump.yaml").write_text((graphs / "jump.yaml").read_text())
    record(checked_file(tmp_path / "jump.yaml", ["duration=0.1 s"]), tmp_path / "run.rrd")
    task = yaml.safe_load((tmp_path / "tasks/in_situ_12cm.yaml").read_text())
    (tmp_path / "tasks/in_situ_12cm.yaml").write_text(yaml.safe_dump({**task, "rise": "9 cm"}))
    opened = OpenedRun.of(tmp_path / "run.rrd")
    assert replay(opened).identical
    assert any("plan.task" in text for text in opened.restored.said)
