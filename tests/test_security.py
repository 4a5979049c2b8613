"""SECURITY.md's table of verbs, walked with a recording that would leave markers if anything of it ran."""

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from aloft.cli import make_app
from aloft.cli.app import all_verbs
from aloft.logs.file.reader import read
from aloft.logs.recording.writer import RecordingWriter
from aloft.logs.replay.opened_run import OpenedRun
from aloft.runtime.language.registry import all_blocks

ROOT = Path(__file__).parent.parent
MODULE = """\
import os
from pathlib import Path
from aloft.blocks.signals import RobotTruth
from aloft import Block, Field, Input, Output, Signal

if os.environ.get("ARMED"):
    Path(os.environ["ARMED"]).touch()

class Number(Signal):
    value = Field(2, unit="m", text="a number")

class Source(Block):
    \"\"\"A stranger's source.\"\"\"
    y = Output(Number, text="two lengths")
    def step(self):
        self.y.value[:] = self.tick

class Sink(Block):
    \"\"\"A stranger's sink.\"\"\"
    u = Input(Number, text="what is read")
    y = Output(Number, text="the same")
    def step(self):
        self.y.value[:] = self.u.value
"""
GRAPH = """\
rate: 100 Hz
duration: 0.2 s
robot: bruce
blocks:
  source: {use: "strange:Source"}
  sink: {use: "strange:Sink", in: {u: source.y}}
  ramp: {use: blocks.Ramp, with: {slope: 1, unit: ""}}
"""
LOOKING: dict[str, list[str]] = {
    "graph": ["graph", "R"],
    "view": ["view", "R", "--out", "OUT/seen.rrd", "--no-show"],
    "plot": ["plot", "R", "source.y.value"],
    "render": ["render", "R", "-o", "OUT/seen.png", "--at", "0.1"],
    "explain": ["explain", "R"],
    "log info": ["log", "info", "R"],
    "log export": ["log", "export", "R", "--csv"],
    "log compare": ["log", "compare", "R", "R"],
    "log repair": ["log", "repair", "R"],
    "log merge": ["log", "merge", "R", "-o", "OUT/merged.rrd"],
    "replay": ["replay", "R", "--check"],
    "branch": ["branch", "R", "--at", "0.1"],
}
"""How each verb is called that takes a recording and runs nothing of it without being told."""
SUCCEED = ("graph", "view", "plot", "log info", "log export", "log compare", "log repair")


def verbs_of(command: Any, name: str = "") -> Iterator[str]:
    inner = getattr(command, "commands", None)
    if not inner:
        yield name
    for each, found in (inner or {}).items():
        yield from verbs_of(found, f"{name} {each}".strip())


def table() -> dict[str, tuple[str, str]]:
    """The table's two entries for each verb."""
    found = {}
    for line in (ROOT / "SECURITY.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 3 and cells[0].startswith("`"):
            found |= dict.fromkeys(re.findall(r"`([^`]+)`", cells[0]), (cells[1], cells[2]))
    return found


@pytest.mark.long
def test_every_verb_is_in_the_table() -> None:
    every = set(verbs_of(typer.main.get_command(make_app(all_verbs()))))
    assert every - {"bench"} == set(table())  # that of the lab, which is no part of the wheel
    promised = {v for v, (_, data) in table().items() if "nothing runs" in data or "again" in data}
    assert promised == set(LOOKING)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording whose robot has a name that climbs, beside the module of its blocks."""
    folder = tmp_path_factory.mktemp("strange") / "inner"
    folder.mkdir()
    (folder / "strange.py").write_text(MODULE)
    (folder / "strange.yaml").write_text(GRAPH)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder.parent / "cache of the stranger"))
        patch.chdir(folder)
        done = CliRunner().invoke(make_app(), ["run", "strange.yaml", "--record", "a.rrd", "-q"])
        assert done.exit_code == 0, done.output
        for name in [n for n in sys.modules if n.partition("@")[0] == "strange"]:
            del sys.modules[name]
    return folder


@pytest.fixture
def armed(hostile: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The marker's path; the module would leave it, and the user has run nothing yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("ARMED", str(tmp_path / "marker"))
    monkeypatch.chdir(hostile)
    return tmp_path / "marker"


@pytest.mark.long
@pytest.mark.parametrize("verb", LOOKING)
def test_looking_runs_nothing(verb: str, hostile: Path, armed: Path) -> None:
    out = armed.parent / "out"
    out.mkdir()
    recording = out / "a.rrd"  # a copy: some verbs write beside it
    recording.write_bytes((hostile / "a.rrd").read_bytes())
    words = [w.replace("OUT", str(out)) for w in LOOKING[verb]]
    words = [str(recording) if w == "R" else w for w in words]
    done = CliRunner().invoke(make_app(), [*words, *(["--folder", "."] if verb in ("replay", "branch", "explain") else [])])  # fmt: skip
    assert not armed.exists(), f"aloft {verb} ran the module"
    assert "strange" not in sys.modules
    if verb in SUCCEED:
        assert done.exit_code == 0, done.output
    elif verb in ("replay", "branch"):
        assert done.exit_code == 2
        text = " ".join(done.output.split())
        for expected in ("strange:Source of source", "strange.py", "SHA-256", "--trust"):
            assert expected in text
    else:  # no jump, no parts, no body in the graph: an error of aloft's, not of Python's
        assert done.exit_code == 2 and "Traceback" not in done.output, done.output


@pytest.mark.long
def test_trust_is_remembered_for_the_content(hostile: Path, armed: Path) -> None:
    run = CliRunner()
    done = run.invoke(make_app(), ["replay", "a.rrd", "--check", "--trust"])
    assert done.exit_code == 0, done.output
    assert armed.exists()
    assert run.invoke(make_app(), ["replay", "a.rrd", "--check"]).exit_code == 0
    before = (hostile / "strange.py").read_text()
    (hostile / "strange.py").write_text(before + "# changed\n")
    try:
        assert run.invoke(make_app(), ["replay", "a.rrd", "--check"]).exit_code == 2
    finally:
        (hostile / "strange.py").write_text(before)


def test_names_in_a_recording_stay_in_a_fresh_folder(
    hostile: Path, tmp_path: Path, armed: Path
) -> None:
    """The file of a header that a stranger made: the robot is called by a path."""
    run = read(hostile / "a.rrd")
    assert run.header.robot is not None
    for name in (str(tmp_path / "written"), "../../written"):
        robot = run.header.robot.model_copy(update={"name": name})
        writer = RecordingWriter(tmp_path / "b.rrd", replace(run.header, robot=robot))
        writer.write_rows(run.ticks, run.rows)
        writer.close()
        done = CliRunner().invoke(make_app(), ["graph", str(tmp_path / "b.rrd")])
        assert done.exit_code == 2 and "cannot be the name of a robot" in " ".join(
            done.output.split()
        )
    assert {p.name for p in tmp_path.iterdir()} == {"b.rrd"}


def test_what_is_looked_at_has_the_recorded_ports(hostile: Path, armed: Path) -> None:
    graph = OpenedRun.of(hostile / "a.rrd", look=True).graph
    source, sink = graph.block("source"), graph.block("sink")
    assert str(source.block_type.outputs["y"].signal.fields["value"].unit) == "m"
    assert sink.wires["u"].source == "source.y"
    assert source.block_type.__doc__ == "A stranger's source."
    assert not armed.exists()


OUTSIDE = {
    "hal.BearRobot", "hopping.Gamepad", "hopping.Keyboard", "ros2.Publish", "ros2.Subscribe",
}  # fmt: skip
"""Every shipped block with an outside: a new one that is not declared is found by what its module imports."""
REACHING = re.compile(
    r"^\s*(?:import|from) (zenoh|serial|socket|pygame|termios|select)\b", re.MULTILINE
)


@pytest.mark.long
def test_every_block_with_an_outside_declares_it() -> None:
    declared, reaching = set(), set()
    for name, block in all_blocks().items():
        if block.outside == "real" or block.acts_outside:
            declared.add(name)
        text = Path(str(sys.modules[block.__module__].__file__)).read_text()
        if REACHING.search(text):
            reaching.add(name)
    assert declared == OUTSIDE
    assert reaching <= declared
