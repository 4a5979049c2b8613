"""A user's own layout: what it shows, and that every fault is told with its place."""

from pathlib import Path

import pytest

from aloft import load
from aloft.logs.file.format import Header
from aloft.logs.file.header import header_of
from aloft.logs.viewing.blueprint import recording_blueprint
from aloft.logs.viewing.own_layout import (
    LayoutError,
    blueprint_with,
    layout_beside,
    read_layout,
)
from aloft.runtime.running.memory import BoundGraph

GRAPH = Path(__file__).parents[3] / "graphs" / "jump.yaml"
GOOD = """follow: false
tabs:
  - name: Balance
    plots:
      - robot.truth.com
      - title: velocity
        signals: [estimator.base.linear_velocity, robot.truth.base_linear_velocity]
        range: [-1, 2]
        legend: true
"""


@pytest.fixture(scope="module")
def header() -> Header:
    return header_of(BoundGraph(load(GRAPH).checked))


def test_a_users_tabs_come_first(header: Header, tmp_path: Path) -> None:
    path = tmp_path / "view.yaml"
    path.write_text(GOOD)
    layout = read_layout(path, header)
    blueprint = blueprint_with(layout, header)
    tabs = blueprint.root_container.contents[1].contents
    assert [tab.name for tab in tabs[:2]] == ["Balance", "Main signals"]
    assert [view.name for view in tabs[0].contents] == ["robot.truth.com [m]", "velocity [m/s]"]
    blueprint.save("aloft", tmp_path / "layout.rbl")
    assert (tmp_path / "layout.rbl").stat().st_size > 1000


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "tabs: [{name: A, plots: [robot.truth.con]}]",
            "1:26: unknown-source: no signal 'robot.truth.con'",
        ),
        ("tabs:\n  - name: A\n", "2:5: missing-key: tabs[0].plots is missing"),
        ("tab: []\n", "1:1: unknown-key: 'tab' is not a key of a layout"),
        ("follow: [\n", "close the bracket or quote"),
        ("follow: true\nfollow: false\n", "2:1: duplicate-key: key 'follow' is there twice"),
        ("tabs: [{name: A, plots: [dynamics.terms.mass_matrix]}]", "too many elements"),
        (
            "tabs: [{name: A, plots: [{signals: [robot.truth.com, robot.joints.torque]}]}]",
            "robot.truth.com [m] and robot.joints.torque [N m]",
        ),
    ],
)
def test_faults_have_their_place(header: Header, tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "view.yaml"
    path.write_text(text)
    with pytest.raises(LayoutError) as error:
        read_layout(path, header)
    assert told in str(error.value)
    assert str(path) in str(error.value)


def test_the_file_beside_the_graph_is_found(header: Header, tmp_path: Path) -> None:
    from dataclasses import replace

    there = replace(header, source=str(tmp_path / "graph.yaml"))
    assert layout_beside(there) is None
    (tmp_path / "view.yaml").write_text(GOOD)
    assert layout_beside(there) == tmp_path / "view.yaml"
    assert layout_beside(replace(header, source="")) is None


LOOP = """
rate: 100 Hz
duration: 1 s
blocks:
  wish: {use: blocks.Step, with: {after: 1 m}}
  error: {use: blocks.Sum, with: {weights: [1, -1]}, in: {a: wish.y, b: {from: place.y, delay: 1}}}
  rate: {use: blocks.Gain, with: {gain: 3 1/s}, in: {u: [error.y]}}
  place: {use: blocks.Integrator, in: {u: rate.y}}
"""


def test_signals_of_a_graph_without_a_robot_fill_the_window(tmp_path: Path) -> None:
    own = header_of(BoundGraph(load(LOOP, path=tmp_path / "loop.yaml").checked))
    root = recording_blueprint(own).root_container
    tabs, below = root.contents
    assert (type(root).__name__, root.row_shares) == ("Vertical", [5, 1])
    assert [view.name for view in tabs.contents[0].contents] == [
        "wish.y.value [m]", "error.y.value [m]", "rate.y.value [m/s]", "place.y.value [m]",
    ]  # fmt: skip
    assert [view.name for view in below.contents] == ["Events"]
