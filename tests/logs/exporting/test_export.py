"""What other programs read of a recorded jump: ROS 2's messages, Foxglove's, Parquet, differences."""

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

import aloft
from aloft import load
from aloft.logs.exporting.difference import ComparisonError, compare_runs, lift_off_tick
from aloft.logs.exporting.export import EXPORTS, ExportError, export, export_mcap, export_parquet
from aloft.logs.file.reader import READ_ALONE, PackedRows, RecordedRun, read
from aloft.logs.recording.recorder import Recorder
from aloft.mathematics.rotations import matrices_of_quaternions, quaternions_of_matrices
from aloft.robots.kinematics import link_poses
from aloft.robots.robot_description import RobotDescription

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[RecordedRun]:
    """A jump up to its landing, and one with another start, 20 ms later."""
    folder = tmp_path_factory.mktemp("export")
    found = []
    for name, extra in (("a", []), ("b", ["robot.seed=3", "robot.sensors.encoder_offset=3 mrad"])):
        path = folder / f"{name}.rrd"
        graph = load(ROOT / "graphs" / "up_5cm.yaml", ["duration=1.5 s", *extra])
        graph.run(sinks=[Recorder(path)], log=False)
        found.append(read(path))
    return found


@pytest.fixture(scope="module")
def robot(runs: list[RecordedRun]) -> RobotDescription:
    robot = runs[0].header.robot
    assert robot is not None
    return robot


@pytest.fixture(scope="module")
def messages(
    runs: list[RecordedRun], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, list[tuple[Any, Any, Any]]]]:
    """Schema, channel and message of everything in the MCAP file, by topic."""
    from mcap.reader import make_reader

    path = tmp_path_factory.mktemp("mcap") / "a.mcap"
    export_mcap(runs[0], path)
    found = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            found[channel.topic].append((schema, channel, message))
    yield found


def decoded(entries: list[tuple[Any, Any, Any]]) -> list[Any]:
    """ROS 2 messages read by rosbags, whose definitions must be those in the file."""
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    schema, channel, _ = entries[0]
    assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
    ours = typesys.get_types_from_msg(schema.data.decode(), schema.name)
    for name, definition in ours.items():
        assert definition[1] == store.fielddefs[name][1], name
    return [store.deserialize_cdr(message.data, schema.name) for *_, message in entries]


def test_joints_are_read_by_name(
    runs: list[RecordedRun], robot: RobotDescription, messages: dict[str, Any]
) -> None:
    states = decoded(messages["/joint_states"])
    assert len(states) == len(runs[0].ticks)
    assert states[3].name == [joint.name for joint in robot.joints]
    for field, name in (("position", "position"), ("velocity", "velocity"), ("torque", "effort")):
        values = np.array([getattr(state, name) for state in states])
        assert values.tobytes() == runs[0][f"robot.joints.{field}"].tobytes()
    stamp = states[501].header.stamp
    assert (stamp.sec, stamp.nanosec) == (1, 2_000_000)
    assert messages["/joint_states"][501][2].log_time == 1_002_000_000


def test_the_sensor_and_the_forces_on_the_feet(
    runs: list[RecordedRun], robot: RobotDescription, messages: dict[str, Any]
) -> None:
    sensed = decoded(messages["/imu"])
    there = sensed[100].linear_acceleration
    np.testing.assert_array_equal(
        [there.x, there.y, there.z], runs[0]["robot.imu.specific_force"][100]
    )
    assert sensed[0].header.frame_id == robot.base
    assert sensed[0].orientation_covariance[0] == -1.0, "it measures no orientation"
    total = np.zeros(len(runs[0].ticks))
    for foot in robot.feet:
        wrenches = decoded(messages[f"/wrench/{foot.name}"])
        total += [each.wrench.force.z for each in wrenches]
        assert max(abs(each.wrench.torque.y) for each in wrenches) > 0.1
    expected = runs[0]["robot.truth.contact_force"][:, :, 2].sum(axis=1)
    np.testing.assert_allclose(total, expected, atol=1e-9)


def test_every_link_has_a_frame(
    runs: list[RecordedRun], robot: RobotDescription, messages: dict[str, Any]
) -> None:
    poses = decoded(messages["/tf"])
    assert len(poses) == 150
    last = poses[-1].transforms
    assert [each.child_frame_id for each in last] == [link.name for link in robot.links]
    names = ("base_position", "base_orientation", "joint_position")
    truth = link_poses(robot, *(runs[0][f"robot.truth.{name}"][745:746] for name in names))
    for each in last:
        place, turn = truth.of(each.child_frame_id)
        t, q = each.transform.translation, each.transform.rotation
        np.testing.assert_array_equal([t.x, t.y, t.z], place[0])
        matrix = matrices_of_quaternions(np.array([[q.x, q.y, q.z, q.w]]))
        np.testing.assert_allclose(matrix, turn, atol=1e-12)


def test_the_scene_and_the_log_are_foxgloves(
    robot: RobotDescription, messages: dict[str, Any]
) -> None:
    ((schema, channel, message),) = messages["/scene"]
    assert (schema.name, channel.message_encoding) == ("foxglove.SceneUpdate", "json")
    entities = {entity["id"]: entity for entity in json.loads(message.data)["entities"]}
    assert set(entities) == {link.name for link in robot.links} | {"ground"}
    assert entities["ground"]["frame_id"] == "world" and entities["ground"]["cubes"]
    assert all(entities[link.name]["frame_id"] == link.name for link in robot.links)
    (shell,) = {tuple(part["color"].values()) for part in entities[robot.base]["triangles"][1:2]}
    assert shell == (0xE6 / 255.0, 0xE9 / 255.0, 0xEE / 255.0, 1.0)
    assert entities["right_hip_shaft"]["spheres"], "a link without shapes is its bones"
    texts = [json.loads(message.data)["message"] for *_, message in messages["/log"]]
    assert "running" in texts


def test_quaternions_come_back_from_matrices() -> None:
    random = np.random.default_rng(0)
    quaternions = random.normal(size=(100, 4))
    quaternions[:4] = np.eye(4)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    back = quaternions_of_matrices(matrices_of_quaternions(quaternions))
    np.testing.assert_allclose(np.abs((back * quaternions).sum(axis=1)), 1.0, atol=1e-12)


def test_a_filter_finds_the_zeros_of_a_column_of_zeros(tmp_path: Path) -> None:
    zeros = {"use": "blocks.Constant", "with": {"value": [0.0]}}
    result = aloft.load({"rate": "10 Hz", "duration": "1 s", "blocks": {"zero": zeros}}).run()
    aloft.write_recording(tmp_path / "a.rrd", result)
    export_parquet(read(tmp_path / "a.rrd"), tmp_path / "a.parquet")
    for rule in (("in", [0.0]), ("==", 0.0), ("<=", 0.0), (">=", 0.0)):
        found = parquet.read_table(tmp_path / "a.parquet", filters=[("zero.y.value[0]", *rule)])
        assert len(found) == 10, rule


def test_parquet_has_joints_and_units(runs: list[RecordedRun], tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    export_parquet(
        runs[0], path, ["robot.joints", "wbc.command.acceleration", "robot.truth.contact_force"]
    )
    table = parquet.read_table(path)
    robot = runs[0].header.robot
    assert robot is not None
    joint = robot.joints[2].name
    column = f"robot.joints.position[{joint}]"
    assert table[column].to_numpy().tobytes() == runs[0]["robot.joints.position"][:, 2].tobytes()
    about = table.schema.field(column).metadata
    assert about[b"unit"] == b"rad" and about[b"element"] == joint.encode()
    assert about[b"signal"] == b"robot.joints.position"
    units = {
        name: table.schema.field(f"wbc.command.acceleration[{name}]").metadata[b"unit"]
        for name in ("base x", "base yaw", joint)
    }
    assert units == {"base x": b"m/s^2", "base yaw": b"rad/s^2", joint: b"rad/s^2"}
    assert "robot.truth.contact_force[left_toe, z]" in table.column_names
    assert json.loads(table.schema.metadata[b"aloft.joints"])[2] == joint


def test_two_runs_are_aligned_at_lift_off(runs: list[RecordedRun]) -> None:
    first, second = runs
    ticks = [lift_off_tick(run) for run in runs]
    assert None not in ticks
    found = compare_runs(first, second)
    assert found.align == "lift-off"
    assert [found.first_tick, found.second_tick] == ticks
    by_name = {each.signal: each for each in found.signals}
    offset = by_name["robot.joints.position"]
    assert offset.unit == "rad" and offset.share is not None and 0.0 < offset.share < 1.0
    shares = [np.inf if each.share is None else each.share for each in found.signals]
    assert shares == sorted(shares, reverse=True)
    assert found.only_first == found.only_second == ()
    # the difference that is told is there, at that time and in that element
    names = [joint.name for joint in first.header.robot.joints]  # type: ignore[union-attr]
    k, at = names.index(offset.element), round(offset.at * 500)
    a = first["robot.joints.position"][first.ticks == found.first_tick + at][0, k]
    b = second["robot.joints.position"][second.ticks == found.second_tick + at][0, k]
    assert abs(a - b) == offset.largest
    same = compare_runs(first, first, "start")
    assert same.signals == () and same.ticks == len(first.ticks) and same.align == "start"


def test_what_cannot_be_compared_is_said(runs: list[RecordedRun]) -> None:
    from dataclasses import replace

    slow = replace(runs[1], header=replace(runs[1].header, base_rate=250.0))
    with pytest.raises(ComparisonError, match=r"a\.rrd has 500 ticks a second and .*b\.rrd 250"):
        compare_runs(runs[0], slow)


def test_a_bag_is_one_that_ros2s_readers_take(
    runs: list[RecordedRun], messages: dict[str, list[tuple[Any, Any, Any]]], tmp_path: Path
) -> None:
    from rosbags.highlevel import AnyReader

    path = tmp_path / "a_bag"
    export("bag", runs[0], path)
    with AnyReader([path]) as bag:
        heard = defaultdict(list)
        for topic, instant, data in bag.messages():
            heard[topic.topic].append((instant, bytes(data)))
            bag.deserialize(data, topic.msgtype)
    cdr = {t: all_ for t, all_ in messages.items() if all_[0][1].message_encoding == "cdr"}
    assert set(heard) == set(cdr) and "/joint_states" in heard and "/log" not in heard
    for topic, known in cdr.items():
        assert heard[topic] == [(m.log_time, m.data) for _, _, m in known]
    with pytest.raises(FileExistsError, match="the folder is there already"):
        export("bag", runs[0], path)
    with pytest.raises(ExportError, match="only what has a type of ROS 2; --mcap writes any"):
        export("bag", runs[0], tmp_path / "b_bag", ["robot.truth"])
    assert [each.name for each in tmp_path.iterdir()] == ["a_bag"]


@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap"])
def test_an_export_never_has_all_rows_in_memory(
    runs: list[RecordedRun], kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: object) -> None:
        raise AssertionError("all rows were read at once")

    monkeypatch.setattr(PackedRows, "rows", refuse)
    monkeypatch.setattr(PackedRows, "signal", refuse)
    path = tmp_path / f"a.{kind}"
    run = read(runs[0].path)
    EXPORTS[kind](run, path, ["robot.truth"] if kind != "mcap" else [])
    assert path.stat().st_size > 10_000
    if kind == "csv":
        lines = path.read_text().splitlines()
        assert len(lines) == len(run.ticks) + 1
        assert lines[-1].startswith(f"{run.ticks[-1]},{float(run.time[-1])!r},")


def test_many_signals_are_read_at_once(
    runs: list[RecordedRun], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = read(runs[0].path)
    names = list(found.signals())
    few = {name: found[name] for name in names[:READ_ALONE]}
    assert "rows" not in vars(found), "few signals do not need all"
    _ = found[names[READ_ALONE]]
    assert found.rows.shape == (len(found.ticks), found.header.bus.size)
    for name, values in few.items():
        np.testing.assert_array_equal(found[name], values)
    monkeypatch.setattr("aloft.logs.file.reader.MOST_KEPT", 1000)
    large = read(runs[0].path)
    for name in names[: READ_ALONE + 2]:
        np.testing.assert_array_equal(large[name], found[name])
    assert "rows" not in vars(large), "what is too large is not kept"
