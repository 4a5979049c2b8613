"""The scene and the layout: geometry, what is drawn of a graph, limits and lanes."""

from pathlib import Path

import numpy as np

from aloft import load
from aloft.logs.file.format import RecordedField
from aloft.logs.file.header import header_of
from aloft.logs.viewing.block_times import times_table
from aloft.logs.viewing.blueprint import main_lanes
from aloft.logs.viewing.limits import limits_of
from aloft.logs.viewing.scene_contacts import cone_lines, convex_hull
from aloft.logs.viewing.scene_ports import scene_ports
from aloft.logs.viewing.state_lanes import lanes_of
from aloft.robots.description import find_robot
from aloft.runtime.running.memory import BoundGraph

GRAPH = Path(__file__).parents[3] / "graphs" / "jump.yaml"


def test_a_cone_is_as_wide_as_friction_allows() -> None:
    line = cone_lines(0.5, 0.06)
    ring = line[np.abs(line[:, 2]) > 1e-12]
    np.testing.assert_allclose(ring[:, 2], 0.06)
    np.testing.assert_allclose(np.hypot(ring[:, 0], ring[:, 1]), 0.03)
    np.testing.assert_array_equal(line[0], 0.0)


def test_the_hull_is_closed_and_leaves_out_what_is_inside() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 2], [0, 1, 3]], float)
    hull = convex_hull(np.vstack([corners, [[0.5, 0.5, 9.0]]]))
    np.testing.assert_array_equal(hull[0], hull[-1])
    assert sorted(map(tuple, hull[:-1])) == sorted(map(tuple, corners))
    x, y = hull[:, 0], hull[:, 1]
    assert 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) == 1.0  # its area, counter-clockwise


def test_a_hull_of_few_points() -> None:
    assert convex_hull(np.zeros((0, 3))).shape == (0, 3)
    assert convex_hull(np.zeros((3, 3))).shape == (0, 3)
    there_and_back = convex_hull(np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]]))
    np.testing.assert_array_equal(there_and_back[:, 0], [0.0, 1.0, 0.0])


def test_all_of_the_jump_is_found() -> None:
    header = header_of(BoundGraph(load(GRAPH).checked))
    ports = scene_ports(header)
    assert ports is not None and ports.estimate is not None
    assert ports.pose.base_position == "robot.truth.base_position"
    assert ports.estimate.base_position == "estimator.base.position"
    assert ports.estimate.joint_position == "robot.joints.position"
    assert (ports.com, ports.contact_force) == ("robot.truth.com", "robot.truth.contact_force")
    assert (ports.plan, ports.feet, ports.push) == ("plan.reference", "landing.feet", "push.push")
    assert ports.friction == header.parameters["wbc.friction"]
    lanes = {lane.entity for lane in main_lanes(header)}
    assert {"states/phase/phase/phase", "states/wbc/command/solved"} <= lanes
    fields = {field.name: field for field in header.bus.fields}
    limits = dict(limits_of(fields["robot.truth.motor_torque"], header))
    peak = find_robot("bruce").profiles["koala"].peak_torque
    assert limits == {"+peak torque": peak, "-peak torque": -peak}
    angles = {value for _, value in limits_of(fields["robot.joints.position"], header)}
    assert angles == {round(v, 9) for v in find_robot("bruce").joint_limits.flatten().tolist()}
    assert limits_of(fields["robot.truth.com"], header) == []


def test_a_problem_that_was_not_solved_is_red() -> None:
    (lane,) = lanes_of(RecordedField("wbc.command.solved", "bool", 0, (), ()), None)
    assert lane.labels == {0: "failed", 1: "solved"} and lane.told
    assert lane.colors[0] == 0xE53935FF
    assert lanes_of(RecordedField("a.b.c", "float64", 0, (), ()), None) == []


def test_the_times_are_a_table() -> None:
    times = {"calls": 3, "mean_us": 1.0, "p50_us": 2.0, "p99_us": 3.0, "max_us": 4.0, "overruns": 1}
    text = times_table({"blocks": {"wbc": times}, "ticks": 3, "wall_time_s": 0.5})
    assert "| wbc | 3 | 1.0 | 2.0 | 3.0 | 4.0 | 1 |" in text
    assert "3 ticks in 0.50 s" in text
