"""Plots of a run in a notebook: lines where the numbers say, names, units, and what is refused."""

import pickle
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import aloft
from aloft.runtime.running.plots import nothing_between
from aloft.runtime.running.run_result import RunResult

GRAPH = """\
rate: 100 Hz
duration: 0.5 s
blocks:
  wave: {use: blocks.SineWave, with: {n: 2, amplitude: 3, frequency: 2 Hz}}
  force: {use: blocks.Constant, with: {value: [7 N]}}
  twice: {use: blocks.Gain, with: {n: 1, gain: 2}, in: {u: force.y}}
"""


@pytest.fixture(scope="module")
def result() -> RunResult:
    return aloft.load(GRAPH).run(plain=True)


def test_a_notebook_shows_a_line_for_each_element(result: RunResult) -> None:
    plot = result.plot("wave.y", "twice.y.value")
    text = plot._repr_svg_()
    root = ElementTree.fromstring(text)
    groups = [g for g in root.iter("{http://www.w3.org/2000/svg}g") if g.get("id") == "line"]
    assert len(groups) == 3
    assert [panel.title for panel in plot.panels] == ["wave.y.value", "twice.y.value [N]"]
    first, second = plot.panels[0].lines
    assert np.array_equal(first.y, result.signal("wave.y.value")[:, 0])
    assert (first.name, second.name) == ("0", "1")
    assert np.array_equal(first.x, result.time)
    assert repr(plot) == "<SignalPlot of wave.y.value, twice.y.value [N]>"


def test_elements_and_a_stretch_of_time(result: RunResult) -> None:
    (panel,) = result.plot("wave.y.value[1]", start=0.1, end=0.2).panels
    (line,) = panel.lines
    assert line.name == "1" and line.x[0] == 0.1 and line.x[-1] == 0.2
    assert np.array_equal(line.y, result.signal("wave.y.value")[10:21, 1])


def test_joints_have_their_names() -> None:
    result = aloft.load("aloft:jump").run(0.01)
    plot = result.plot("robot.joints.position[*_knee]", "estimator.base.linear_velocity")
    knees, velocity = plot.panels
    assert knees.title == "robot.joints.position [rad]"
    assert [line.name for line in knees.lines] == ["right_knee", "left_knee"]
    assert [line.name for line in velocity.lines] == ["x", "y", "z"]
    assert velocity.title.endswith("[m/s]")
    again: RunResult = pickle.loads(pickle.dumps(result))
    assert again.graph is None
    assert again.plot("robot.joints.position[4]").panels[0].lines[0].name == "4"


def test_files(result: RunResult, tmp_path: Path) -> None:
    plot = result.plot("wave.y")
    plot.save(tmp_path / "a.svg")
    plot.save(tmp_path / "a.png")
    assert (tmp_path / "a.svg").read_text() == plot.svg()
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match=r"a plot is written as \.svg or \.png"):
        plot.save(tmp_path / "a.pdf")


def test_what_is_refused(result: RunResult) -> None:
    with pytest.raises(KeyError, match=r"the nearest is wave\.y\.value"):
        result.plot("wave.x.value")
    with pytest.raises(ValueError, match=r"wave\.y\.value\[5\]: "):
        result.plot("wave.y.value[5]")
    with pytest.raises(ValueError, match="nothing was recorded from 3 s on"):
        result.plot("wave.y", start=3)
    with pytest.raises(ValueError, match="name a signal to plot"):
        result.plot()
    with pytest.raises(RuntimeError):
        aloft.load("aloft:jump").run(0.002, log=False).plot("robot.joints")


def test_ends_of_time_without_ticks_are_said_in_words() -> None:
    assert nothing_between(None, None) == "nothing was recorded: there is no tick"
    assert nothing_between(None, 2.0) == "nothing was recorded until 2 s"
    assert nothing_between(1.0, 2.5) == "nothing was recorded between 1 s and 2.5 s"
