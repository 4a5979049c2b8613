"""A mounted sensor is recorded, drawn, exported for ROS 2's tools and published, with no further code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import aloft
from aloft.logs.exporting.export import export_mcap
from aloft.logs.file.reader import RecordedRun, read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.scene_ports import ports_of
from aloft.logs.viewing.scene_sensors import sensor_ports

from .mounting import write_bruce_with

SOLES: dict[str, Any] = {
    f"{side}_sole": {
        "kind": "force_torque", "link": f"{side}_foot", "position": [0.0075, 0.0, -0.024],
    }
    for side in ("right", "left")
}  # fmt: skip
GRAPH = """\
rate: 500 Hz
duration: 0.1 s
robot: sensing.yaml
blocks:
  robot: {use: hal.MujocoRobot, in: {command: {value: {mode: 2}}}}
"""
PUBLISH = """\
  publish:
    use: ros2.Publish
    with: {topic: /left_sole, type: geometry_msgs/msg/WrenchStamped, texts: {frame_id: left_foot}, frame: left_foot}
    in: {message: {wrench_force: robot.left_sole.force, wrench_torque: robot.left_sole.torque}}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    folder = tmp_path_factory.mktemp("soles")
    write_bruce_with(folder, **SOLES)
    (folder / "graph.yaml").write_text(GRAPH)
    aloft.load(folder / "graph.yaml").run(sinks=[Recorder(folder / "run.rrd")], log=False)
    return read(folder / "run.rrd")


def test_it_is_recorded_with_units(run: RecordedRun) -> None:
    fields = {field.name: field for field in run.header.bus.fields}
    assert run["robot.left_sole.force"].shape == (50, 3)
    assert run["robot.left_sole.force"][:, 2].max() > 10.0
    assert str(fields["robot.left_sole.torque"].unit) == "N m"


def test_it_is_drawn_where_it_is_mounted(run: RecordedRun) -> None:
    robot = run.header.robot
    assert robot is not None
    found = sensor_ports(robot, ports_of(run.header))
    assert list(found) == ["robot.right_sole", "robot.left_sole"]
    origin, vector = drawn(run)["/world/sensors/left_sole"]
    sole = run["robot.truth.contact_position"][0, 2:].mean(axis=0)
    np.testing.assert_allclose(origin, sole, atol=1e-3)
    force = run["robot.left_sole.force"][0]
    assert vector @ force > 0.99 * np.linalg.norm(vector) * np.linalg.norm(force) > 0.0


def drawn(run: RecordedRun) -> dict[str, tuple[Any, Any]]:
    """The first arrow of every sensor's entity: where it begins, and its vector."""
    from rerun.chunk import RrdReader

    found: dict[str, tuple[Any, Any]] = {}
    for chunk in RrdReader(run.path).stream().filter(content="/world/sensors/**"):
        batch = chunk.to_record_batch()
        if "Arrows3D:vectors" in batch.schema.names:
            columns = (batch[f"Arrows3D:{name}"].to_pylist()[0] for name in ("origins", "vectors"))
            origins, vectors = columns
            found.setdefault(str(chunk.entity_path), (np.array(origins[0]), np.array(vectors[0])))
    return found


def test_mcap_has_a_channel_with_its_message(run: RecordedRun, tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    typesys = pytest.importorskip("rosbags.typesys")
    export_mcap(run, tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as file:
        messages = list(reader.make_reader(file).iter_messages(topics=["/left_sole"]))
    assert messages[0][0].name == "geometry_msgs/msg/WrenchStamped"
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    read_back = [store.deserialize_cdr(m.data, schema.name) for schema, _, m in messages]
    assert read_back[0].header.frame_id == "left_foot"
    assert [each.wrench.force.z for each in read_back] == run["robot.left_sole.force"][
        :, 2
    ].tolist()
    assert [each.wrench.torque.y for each in read_back] == (
        run["robot.left_sole.torque"][:, 1].tolist()
    )


def test_ros2_publishes_it_by_two_wires(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    write_bruce_with(tmp_path, **SOLES)
    (tmp_path / "graph.yaml").write_text(GRAPH + PUBLISH)
    assert "publish" in {block.path for block in aloft.load(tmp_path / "graph.yaml").checked.blocks}


@pytest.mark.long
def test_a_sensor_of_a_users_own_module(tmp_path: Path) -> None:
    page = (Path(aloft.__file__).parent / "docs/robots.md").read_text(encoding="utf-8")
    own = page.partition("### A sensor of a new kind")[2].partition("```python\n")[2]
    (tmp_path / "range_finder.py").write_text(own.partition("```")[0])
    write_bruce_with(
        tmp_path,
        height={"kind": "range_finder:RangeFinder", "link": "torso", "position": [0, 0, -0.1]},
    )
    (tmp_path / "graph.yaml").write_text(GRAPH)
    recording = tmp_path / "run.rrd"
    aloft.load(tmp_path / "graph.yaml").run(sinks=[Recorder(recording)], log=False)
    run = read(recording)
    height = run["robot.truth.base_position"][0, 2] - 0.1
    assert run["robot.height.distance"][0] == pytest.approx(height, abs=2e-3)
    assert yaml.safe_load((tmp_path / "sensing.yaml").read_text())["sensors"]["height"]
