"""``aloft plot``: in the terminal and into files, by signal, port and element."""

from pathlib import Path

import numpy as np
import pytest

from aloft.cli.plot import in_terminal
from aloft.plotting import Curve, Panel, panels_svg

from .conftest import Call

GRAPH = """
rate: 100 Hz
duration: 1 s
blocks:
  wave: {use: blocks.SineWave, with: {n: 2, unit: m}}
  twice: {use: blocks.Gain, with: {n: 2, gain: 2}, in: {u: wave.y}}
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from aloft import load, write_recording

    path = tmp_path_factory.mktemp("plot") / "wave.rrd"
    write_recording(path, load(GRAPH).run())
    return path


def test_a_plot_in_the_terminal_has_title_names_and_ranges(recording: Path, call: Call) -> None:
    text = call("plot", str(recording), "twice.y.value").stdout
    lines = text.splitlines()
    assert lines[0].startswith("twice.y.value [m]") and "0, 1" in lines[0]
    assert lines[1].split()[0] == "2" and lines[12].split()[0] == "-2"
    assert lines[13].split()[0] == "0" and lines[13].split()[-1] == "0.99"


def test_elements_ports_and_times(recording: Path, call: Call) -> None:
    text = call("plot", str(recording), "wave.y[1]", "--from", "0.2", "--to", "0.5").stdout
    assert text.splitlines()[-1].split() == ["0.2", "time", "[s]", "0.5"]
    assert "error" not in text
    assert text.splitlines()[0] == "wave.y.value [m]: 1"  # which element it is


def test_recordings_are_drawn_over_each_other(recording: Path, call: Call, tmp_path: Path) -> None:
    from aloft import load, write_recording

    other = tmp_path / "larger.rrd"
    write_recording(other, load(GRAPH, {"wave.amplitude": 3.0, "duration": 0.5}).run())
    lines = call("plot", str(recording), str(other), "wave.y[0]").stdout.splitlines()
    assert lines[0] == "wave.y.value [m]: wave 0, larger 0"
    assert lines[1].split()[0] == "3" and lines[-1].split()[-1] == "0.99"
    assert "which signals?" in call("plot", str(recording), str(other), code=2).stderr


def test_files(recording: Path, call: Call, tmp_path: Path) -> None:
    files = [str(tmp_path / name) for name in ("a.svg", "a.png")]
    done = call("plot", str(recording), "wave.y", "twice.y", "--svg", files[0], "--png", files[1])
    assert done.stderr.splitlines() == [f"plot: {file}" for file in files]
    assert "<svg" in (tmp_path / "a.svg").read_text()
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["wvae.y.value"], "no signal 'wvae.y.value'; the nearest are wave.y.value"),
        (["wave.y[5]"], "wave.y[5]: [5] is outside of 2 elements"),
        (["wave.y", "--from", "7"], "nothing was recorded from 7 s on"),
        (["wave.y", "--svg", "no/such/file.svg"], "cannot write the plot"),
    ],
)
def test_mistakes(recording: Path, call: Call, arguments: list[str], message: str) -> None:
    assert message in call("plot", str(recording), *arguments, code=2).stderr


def test_constants_and_gaps_are_drawn() -> None:
    x = np.linspace(0.0, 1.0, 50)
    text = in_terminal(Panel("flat", [Curve("", x, np.where(x < 0.5, 3.0, np.nan))]))
    assert text.splitlines()[1].split()[0] == "3.5"
    assert any(character > "\u2800" for character in text)


def test_an_enumeration_has_names_on_its_axis() -> None:
    x = np.arange(4.0)
    panel = Panel(
        "phase",
        [Curve("", x, np.array([0.0, 1.0, 1.0, 3.0]))],
        y_names={0: "squat", 1: "thrust", 2: "flight", 3: "landing"},
    )
    text = in_terminal(panel)
    assert all(name in text for name in ("squat", "thrust", "landing")) and "flight" not in text
    svg = panels_svg([panel, panel], "")
    assert svg.count(">landing<") == 2 and ">flight<" not in svg, "those that occur"
    assert svg.count(">time [s]<") == 1, "x is named once"
