"""The plots of the viewer: their titles, legends and pages; and the names of lines and lanes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft import load
from aloft.logs.file.format import Header, RecordedField
from aloft.logs.file.header import header_of
from aloft.logs.viewing.contacts import force_arrows
from aloft.logs.viewing.plot_views import MOST_IN_TAB, ShownRun, block_tabs, legend, main_plots
from aloft.logs.viewing.scene_ports import scene_ports
from aloft.logs.viewing.signal_names import element_names, unit_of
from aloft.logs.viewing.state_lanes import all_lanes
from aloft.robots.description import find_robot
from aloft.robots.robot_description import RobotDescription
from aloft.runtime.running.memory import BoundGraph

GRAPH = Path(__file__).parents[3] / "graphs" / "jump.yaml"


@pytest.fixture(scope="module")
def header() -> Header:
    return header_of(BoundGraph(load(GRAPH).checked))


def field(header: Header, name: str) -> RecordedField:
    return next(f for f in header.bus.fields if f.name == name)


def test_generalised_quantities_are_named_by_base_and_joints(header: Header) -> None:
    robot = header.robot
    assert robot is not None
    acceleration = field(header, "wbc.command.acceleration")
    names = element_names(acceleration, robot)
    assert names[:6] == ["base x", "base y", "base z", "base roll", "base pitch", "base yaw"]
    assert names[6:] == [joint.name for joint in robot.joints]
    assert unit_of(acceleration) == "m/s^2, rad/s^2"
    assert unit_of(field(header, "dynamics.terms.nonlinear_effects")) == "N, N m"
    assert unit_of(field(header, "robot.truth.com")) == "m"
    drift = field(header, "dynamics.terms.centroidal_drift")
    assert element_names(drift, robot)[::5] == ["linear x", "angular z"]


def test_no_legend_of_a_shipped_graph_has_numbers(header: Header) -> None:
    for entry in header.bus.fields:
        if len(entry.shape) == 1 and not entry.constant and entry.dimensions[0] not in (2, 5):
            names = element_names(entry, header.robot)
            assert not any(name.isdigit() for name in names), entry.name


def test_long_vectors_keep_their_names() -> None:
    talos: RobotDescription = find_robot("talos")
    size = talos.dimensions["n_velocities"]
    entry = RecordedField("a.b.acceleration", "float64", 0, (size,), ("n_velocities",))
    assert len(element_names(entry, talos)) == size
    matrix = replace(entry, shape=(size, size), dimensions=("n_velocities", "n_velocities"))
    assert element_names(matrix, talos) == []


def test_lanes_have_the_shortest_names_that_differ(header: Header) -> None:
    lanes = all_lanes(header)
    entities = [lane.entity for lane in lanes]
    assert len(entities) == len(set(entities))
    found = {lane.field.name: lane.entity for lane in lanes if not lane.field.shape}
    assert found["phase.phase.phase"] == "states/phase"
    assert found["plan.reference.phase"] == "states/plan.phase"
    assert found["wbc.command.solved"] == "states/solved"
    assert all(entity.count("/") == 1 for entity in entities)


def names_of(views: list[Any]) -> list[str]:
    return [str(view.name) for view in views]


def test_the_first_plots_are_few_and_say_what_is_what(header: Header) -> None:
    views = main_plots(header, scene_ports(header), (ShownRun(),))
    names = names_of(views)
    assert len(views) <= MOST_IN_TAB
    assert "centre of mass [m], world · xyz: RGB, dark: planned" in names
    assert "vertical force on each foot [N]" in names
    assert not any("contact_force" in name for name in names)
    two = main_plots(
        header, scene_ports(header), (ShownRun("first/", "a"), ShownRun("second/", "b"))
    )
    assert all("bold a, thin b" in name for name in names_of(two))


def test_a_block_with_many_signals_has_pages(header: Header) -> None:
    tabs = {tab.name: tab for tab in block_tabs(header, (ShownRun(),))}
    pages = tabs["dynamics"].contents
    assert len(pages) > 1
    for tab in tabs.values():
        nested = [part for part in tab.contents if hasattr(part, "contents") and part.name]
        for page in nested or [tab]:
            assert len(getattr(page, "contents", ())) <= MOST_IN_TAB or page.origin is not None


def test_a_long_legend_is_hidden() -> None:
    def visible(count: int) -> bool:
        return bool(legend(count).visible.as_arrow_array().to_pylist()[0])

    assert [visible(count) for count in (1, 3, 4, 5, 12)] == [False, True, True, False, False]


def test_arrows_are_visible_at_rest_and_end_in_the_view() -> None:
    for name in ("solo12", "bruce", "talos"):
        robot = find_robot(name)
        weight = 9.81 * robot.total_mass
        reach = float(np.linalg.norm(force_arrows(robot, np.array([0.0, 0.0, 100.0 * weight]))))
        at_rest = force_arrows(robot, np.array([0.0, 0.0, weight / 4]))
        assert at_rest[2] >= 0.1 * reach, "a quarter of the weight is a tenth of the longest arrow"
        forces = np.array([[0.0, 30.0 * weight, 40.0 * weight], [0.0, 0.0, 0.0]])
        arrows = force_arrows(robot, forces)
        np.testing.assert_allclose(np.linalg.norm(arrows, axis=1), [reach, 0.0])
        np.testing.assert_allclose(arrows[0] / reach, [0.0, 0.6, 0.8], atol=1e-12)
