"""The scene and the layout: geometry, what is drawn of a graph, limits and lanes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aloft import load
from aloft.logs.file.format import Header, RecordedField
from aloft.logs.file.header import header_of
from aloft.logs.file.reader import read
from aloft.logs.recording.writer import RecordingWriter
from aloft.logs.viewing.blueprint import main_lanes
from aloft.logs.viewing.contacts import cone_lines, convex_hull
from aloft.logs.viewing.plot_views import limits_of
from aloft.logs.viewing.scene_ports import OTHERS, PUSH, ROLES, PoseSource, port_of, scene_ports
from aloft.logs.viewing.state_lanes import lanes_of, times_table
from aloft.robots.description import find_robot
from aloft.robots.terrain import Ground, Terrain
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
    assert {
        "states/phase",
        "states/plan.phase",
        "states/solved",
        "states/contacts.active.left_heel",
    } <= lanes
    fields = {field.name: field for field in header.bus.fields}
    limits = dict(limits_of(fields["robot.truth.motor_torque"], header))
    peak = find_robot("bruce").profiles["koala"].peak_torque
    assert limits == {"+peak torque": peak, "-peak torque": -peak}
    angles = {value for _, value in limits_of(fields["robot.joints.position"], header)}
    assert angles == {round(v, 9) for v in find_robot("bruce").joint_limits.flatten().tolist()}
    assert limits_of(fields["robot.truth.com"], header) == []


def test_every_role_is_a_signal_of_the_vocabulary() -> None:
    from aloft.blocks import signals
    from aloft.extensions.hopping import signals as hopping
    from aloft.runtime.language.signals import Signal

    for role in ROLES:
        fields = getattr(signals, role.signal).fields
        assert {name.partition(":")[0] for name in role.fields} <= set(fields)
        assert not set(role.lacks) & set(fields)
    types = {n for n in signals.__all__ if issubclass(getattr(signals, n), Signal)}
    types |= {
        n
        for n, kind in vars(hopping).items()
        if isinstance(kind, type)
        and kind.__module__ == hopping.__name__
        and issubclass(kind, Signal)
    } - {"PlanRows"}
    assert types == {role.signal for role in ROLES} | set(OTHERS)


def field(name: str, *signals: str, shape: tuple[int | str, ...] = (3,)) -> RecordedField:
    return RecordedField(name, "float64", 0, (3,), shape, signals=signals)


def test_a_ports_type_comes_before_its_fields() -> None:
    fields = [
        field("a.push.force", "JointCommand"), field("a.push.point", "JointCommand"),
        field("b.kick.force", "Kick"), field("b.kick.point", "Kick"),
        field("c.push.force", "Shove", "ExternalForce"),
        field("c.push.point", "Shove", "ExternalForce"),
    ]  # fmt: skip

    def found(*chosen: RecordedField) -> str | None:
        ports: dict[str, dict[str, RecordedField]] = {}
        for each in chosen:
            ports.setdefault(each.name.rpartition(".")[0], {})[each.field_name] = each
        return port_of(ports, PUSH)

    assert found(*fields) == "c.push", "it derives from the type"
    assert found(*fields[:4]) == "b.kick", "a type of one's own with the same fields"
    assert found(*fields[:2]) is None, "a signal of the vocabulary is what it is"
    old = [field(each.name) for each in fields[:2]]
    assert found(*old) == "a.push", "old recordings keep no types"


def test_a_recording_keeps_the_names_of_signals() -> None:
    header = header_of(BoundGraph(load(GRAPH).checked))
    again = Header.from_json(header.to_json())
    assert again.bus == header.bus
    (truth,) = [f for f in again.bus.fields if f.name == "robot.truth.com"]
    assert truth.signals == ("RobotTruth",)


def test_a_joint_without_limits_has_no_lines() -> None:
    robot = find_robot("bruce")
    free = [joint.model_copy(update={"limits": None}) for joint in robot.joints]
    header = replace(
        header_of(BoundGraph(load(GRAPH).checked)), robot=robot.changed(joints=tuple(free))
    )
    fields = {field.name: field for field in header.bus.fields}
    assert limits_of(fields["robot.joints.position"], header) == []
    assert len(limits_of(fields["robot.truth.motor_speed"], header)) == 2


def test_a_fixed_base_is_posed_by_its_joints() -> None:
    header = header_of(BoundGraph(load(GRAPH).checked))
    robot = header.robot
    assert robot is not None
    joints = tuple(f for f in header.bus.fields if f.name.startswith("robot.joints."))
    arm = replace(
        header,
        robot=robot.changed(base_joint="fixed", feet=(), contacts=()),
        bus=replace(header.bus, fields=joints),
    )
    ports = scene_ports(arm)
    assert ports is not None and ports.pose == PoseSource(None, None, "robot.joints.position")
    assert ports.contact_force is None and ports.estimate is None
    assert scene_ports(replace(arm, robot=robot)) is None, "a floating base has to be known"


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


GRAPHS = Path(__file__).parents[3] / "graphs"


def boxes_of(path: Path) -> Any:
    from rerun.chunk import RrdReader

    chunks = RrdReader(path).stream().filter(content="/world/ground")
    return [chunk.to_record_batch() for chunk in chunks]


def written(tmp_path: Path, header: Header) -> Path:
    path = tmp_path / "run.rrd"
    RecordingWriter(path, header).close()
    return path


def test_a_step_is_drawn(tmp_path: Path) -> None:
    header = header_of(BoundGraph(load(GRAPHS / "up_5cm.yaml").checked))
    assert header.terrain is not None and header.terrain.blocks[0].most[2] == 0.05
    path = written(tmp_path, header)
    assert read(path).header.terrain == header.terrain
    (batch,) = boxes_of(path)
    centre = np.array(batch["Boxes3D:centers"].to_pylist()[0])
    half = np.array(batch["Boxes3D:half_sizes"].to_pylist()[0])
    block = header.terrain.blocks[0]
    np.testing.assert_allclose(centre - half, [block.least], atol=1e-6)
    np.testing.assert_allclose(centre + half, [block.most], atol=1e-6)


def test_a_platform_has_a_floor_below_it(tmp_path: Path) -> None:
    header = header_of(BoundGraph(load(GRAPHS / "jump.yaml").checked))
    platform = Terrain(-0.35, (Ground((-0.5, -0.4, -0.35), (0.1, 0.4, 0.0)),))
    (batch,) = boxes_of(written(tmp_path, replace(header, terrain=platform)))
    assert len(batch["Boxes3D:centers"].to_pylist()[0]) == 2


def test_level_ground_is_the_viewers_grid(tmp_path: Path) -> None:
    header = header_of(BoundGraph(load(GRAPHS / "jump.yaml").checked))
    assert header.terrain == Terrain()
    assert boxes_of(written(tmp_path, header)) == []


def test_plots_show_every_value(tmp_path: Path) -> None:
    # a mean over neighbouring values halves the peak of a touchdown and draws force into the flight
    from rerun.chunk import RrdReader

    path = written(tmp_path, header_of(BoundGraph(load(GRAPHS / "jump.yaml").checked)))
    policies = {}
    for chunk in RrdReader(path).stream().filter(content="/**"):
        batch = chunk.to_record_batch()
        if "SeriesLines:aggregation_policy" in batch.schema.names:
            (found,) = batch["SeriesLines:aggregation_policy"].to_pylist()
            policies[str(chunk.entity_path)] = found
    assert set(map(tuple, policies.values())) == {(1,)}  # AggregationPolicy.Off
    assert {"/signals/robot/truth/com", "/plots/foot_force"} <= set(policies)
