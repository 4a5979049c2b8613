"""The recording of a run: read back bit for bit, and shown by name."""

import json
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.logs.file.format import RecordedField
from aloft.logs.file.header import make_header
from aloft.logs.file.reader import read
from aloft.logs.recording.drawn_run import write_view
from aloft.logs.recording.writer import write_recording
from aloft.logs.viewing.contacts import Flights
from aloft.logs.viewing.robot_shapes import quaternion_from_z
from aloft.logs.viewing.scene_ports import scene_ports
from aloft.logs.viewing.signal_names import element_names
from aloft.mathematics.rotations import matrices_of_quaternions
from aloft.robots.description import RobotDescription
from aloft.runtime.language.block import Block, Output, State
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.running.executor import run
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.testing.graphs import BlockUse, checked_graph

TICKS = 300


class Stage(IntEnum):
    GROUND = 0
    AIR = 1


class HopperTruth(Signal):
    base_position = Field(3, unit="m", frame="world")
    base_orientation = Field(4, unit="")
    joint_position = Field("n_joints", unit="rad")
    com = Field(3, unit="m", frame="world")
    contact_position = Field(("n_contacts", 3), unit="m", frame="world")
    contact_force = Field(("n_contacts", 3), unit="N", frame="world")
    stage = Field(dtype="int64", values=Stage)
    closed = Field("n_contacts", dtype="bool")


class Seed(Signal):
    value = Field(dtype="int64")


class Hopper(Block):
    """A robot that is off the ground from tick 100 to 199, with numbers no decimal can hold."""

    truth = Output(HopperTruth, truth=True)
    state = State(Seed)

    def emit(self) -> None:
        tick = self.tick
        in_air = 100 <= tick < 200
        self.truth.base_position[...] = (tick / 3.0, -np.pi * tick, 1.0)
        self.truth.base_orientation[...] = (0.0, 0.0, 0.0, 1.0)
        self.truth.joint_position[...] = (tick * 1e-300, np.nextafter(1.0, 2.0))
        self.truth.com[...] = tick * 0.1
        self.truth.contact_position[...] = 0.25
        self.truth.contact_force[...] = 0.0 if in_air else 50.0 / 7.0
        self.truth.stage[()] = Stage.AIR if in_air else Stage.GROUND
        self.truth.closed[...] = not in_air

    def update(self) -> None:
        self.state.value[()] = self.tick


def hopper_description() -> RobotDescription:
    shape = {"start": (0, 0, 0), "end": (0, 0, -0.2), "radius": 0.02}
    link = {"mass": 1.0, "com": (0, 0, 0), "inertia": (0.01, 0.01, 0.01, 0, 0, 0)}
    joint = {"axis": (0, 1, 0), "limits": (-1, 1), "origin": (0, 0, -0.2)}
    return RobotDescription.model_validate(
        {
            "name": "hopper",
            "base": "body",
            "links": [
                {"name": "body", **link},
                {"name": "thigh", "shapes": [shape], **link},
                {"name": "shank", **link},
            ],
            "joints": [
                {"name": "hip", "parent": "body", "child": "thigh", **joint},
                {"name": "knee", "parent": "thigh", "child": "shank", **joint},
            ],
            "feet": [{"name": "foot", "link": "shank", "sole": (0, 0, -0.2)}],
            "contacts": [
                {"name": name, "foot": "foot", "position": (0, 0, 0), "radius": 0.005}
                for name in ("toe", "heel")
            ],
            "transmission": {"motors": ("a", "b"), "joint_to_motor": [[1, 0], [0, 1]]},
            "profiles": {},
            "standing": {},
        }
    )


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[CheckedGraph, RunResult, Path]:
    graph = checked_graph(
        {"robot": BlockUse(Hopper), "leg/robot": BlockUse(Hopper)},
        robot=hopper_description(),
        ticks=TICKS,
    )
    result = run(graph)
    path = tmp_path_factory.mktemp("recording") / "new folder" / "hop.rrd"
    recording = write_recording(path, result)
    assert recording.path == path
    assert recording.size == path.stat().st_size
    assert 0 < recording.seconds < 60
    return graph, result, path


@pytest.fixture(scope="module")
def drawn(recorded: tuple[CheckedGraph, RunResult, Path]) -> Path:
    """What ``aloft view`` shows of the recording."""
    *_, path = recorded
    return write_view(path.with_name("view.rrd"), read(path))


def batches(path: Path, content: str) -> dict[str, Any]:
    """The chunks of the matching entities as Arrow record batches, static ones left out."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).stream().filter(content=content):
        if not chunk.is_static:
            found[chunk.entity_path.lstrip("/")] = chunk.to_record_batch()
    return found


def test_every_signal_of_every_tick_is_read_back_exactly(
    recorded: tuple[CheckedGraph, RunResult, Path],
) -> None:
    _, result, path = recorded
    for name, signal in read(path).signals().items():
        assert read(path)[name].tobytes() == result.signal(name).tobytes(), signal.name


def test_every_signal_is_drawn_in_every_tick_in_which_it_changes(
    recorded: tuple[CheckedGraph, RunResult, Path], drawn: Path
) -> None:
    from rerun.chunk import RrdReader

    result, path = recorded[1], drawn
    found: dict[str, list[Any]] = {}
    for chunk in RrdReader(path).stream().filter(content="/signals/**"):
        if not chunk.is_static:
            found.setdefault(chunk.entity_path.lstrip("/"), []).append(chunk.to_record_batch())
    names = list(result.signals())
    assert set(found) == {f"signals/{name.replace('.', '/')}" for name in names}
    assert len(names) == 2 * len(HopperTruth.fields)
    for name in names:
        some = found[f"signals/{name.replace('.', '/')}"]
        expected = result.signal(name)
        ticks = np.concatenate([batch["tick"].to_numpy() for batch in some])
        flat = np.concatenate([batch["Scalars:scalars"].flatten().to_numpy() for batch in some])
        last = np.searchsorted(ticks, np.arange(TICKS), side="right") - 1  # written at or before
        values = flat.reshape(len(ticks), *expected.shape[1:])[last]
        assert values.astype(expected.dtype).tobytes() == expected.tobytes(), name
        assert {0, TICKS - 1} <= set(ticks.tolist())
        instants = np.concatenate([batch["t"].cast("int64").to_numpy() for batch in some])
        assert instants.tolist() == [tick * 2_000_000 for tick in ticks.tolist()]
        if name.endswith("base_position"):
            assert len(ticks) == TICKS  # it changes in every tick
        if name.endswith("contact_position"):
            assert len(ticks) == 2  # it never does


def test_a_recording_has_the_curves_that_are_shown_first(
    recorded: tuple[CheckedGraph, RunResult, Path],
) -> None:
    *_, path = recorded
    assert set(batches(path, "/signals/**")) == {
        f"signals/robot/truth/{name}" for name in ("com", "base_position")
    }
    assert set(batches(path, "/states/**")) == {"states/robot.stage", "states/leg.robot.stage"}
    thigh = batches(path, "/world/robot/**")["world/robot/thigh"]
    assert thigh["tick"].to_pylist() == list(range(0, TICKS, 10))  # 50 Hz of 500 Hz


def test_states_and_events_are_said_by_name(drawn: Path) -> None:
    path = drawn
    states = batches(path, "/states/**")
    batch = states["states/robot.stage"]
    assert batch["StateChange:state"].flatten().to_pylist() == ["ground", "air", "ground"]
    assert batch["tick"].to_pylist() == [0, 100, 200]
    fields = ("stage", "closed.toe", "closed.heel")
    robots = ("robot", "leg.robot")
    assert set(states) == {f"states/{robot}.{field}" for robot in robots for field in fields}
    toe = states["states/robot.closed.toe"]
    assert toe["StateChange:state"].flatten().to_pylist() == ["closed", "no", "closed"]
    from rerun.chunk import RrdReader

    lines = set()
    for chunk in RrdReader(path).stream().filter(content="/events"):
        batch = chunk.to_record_batch()
        texts = batch["TextLog:text"].flatten().to_pylist()
        lines |= set(zip(batch["tick"].to_pylist(), texts, strict=True))
    assert (100, "0.200 s  robot.truth.stage: air") in lines
    assert (100, "0.200 s  lift-off") in lines
    assert (200, "0.400 s  touchdown") in lines


def test_the_robot_is_posed_in_space(
    recorded: tuple[CheckedGraph, RunResult, Path], drawn: Path
) -> None:
    graph, result, _ = recorded
    path = drawn
    assert result.log is not None and result.log.layout is not None
    ports = scene_ports(make_header(graph, result.log.layout, b""))
    assert ports is not None and ports.pose.base_position == "robot.truth.base_position"
    found = batches(path, "/world/**")
    links = {f"world/robot/{name}" for name in ("body", "thigh", "shank")}
    others = ("contact_forces", "com", "com_projection", "eye", "support_polygon")
    assert set(found) == links | {f"world/{name}" for name in others}
    lines = found["world/support_polygon"]["LineStrips3D:strips"]
    assert [len(row) for row in lines] == [0] * 60  # both points are in one place
    thigh = found["world/robot/thigh"]
    assert thigh["tick"].to_pylist() == list(range(0, TICKS, 5))  # 100 Hz of 500 Hz
    places = thigh["Transform3D:translation"].flatten().flatten().to_numpy().reshape(-1, 3)
    np.testing.assert_allclose(places[2], [10 / 3, -np.pi * 10, 0.8], rtol=1e-6)
    arrows = found["world/contact_forces"]["Arrows3D:vectors"]
    assert [len(row) for row in arrows] == [2] * 60


def test_the_file_says_how_to_repeat_the_run(
    recorded: tuple[CheckedGraph, RunResult, Path],
) -> None:
    from rerun.chunk import RrdReader

    _, result, path = recorded
    properties = {}
    for chunk in RrdReader(path).stream().filter(content="/__properties/**"):
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            properties[name.rpartition(":")[2]] = batch[name].to_pylist()[0]
    assert properties["run_hash"] == [result.run_hash]
    assert properties["success"] == ["True"]
    assert "rerun-sdk" in json.loads(properties["versions"][0])
    assert properties["base_rate_hz"] == ["500.0"]


def test_what_cannot_be_written_is_an_os_error(
    recorded: tuple[CheckedGraph, RunResult, Path], tmp_path: Path
) -> None:
    _, result, _ = recorded
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        write_recording(tmp_path / "file" / "hop.rrd", result)
    with pytest.raises(IsADirectoryError):
        write_recording(tmp_path, result)


def test_a_run_without_a_log_cannot_be_recorded(tmp_path: Path) -> None:
    graph = checked_graph({"robot": BlockUse(Hopper)}, robot=hopper_description(), ticks=3)
    with pytest.raises(RuntimeError, match="log=True"):
        write_recording(tmp_path / "hop.rrd", run(graph, log=False))
    assert not (tmp_path / "hop.rrd").exists()


@pytest.mark.parametrize(
    ("loaded", "events"),
    [
        ([1, 1, 1, 1], []),
        ([1, 0, 0, 1], [(1, "lift-off"), (3, "touchdown")]),
        ([1, 0, 1, 1], []),  # too short
        ([1, 1, 0, 0], [(2, "lift-off")]),  # still in the air at the end
    ],
)
def test_flights_are_found(loaded: list[int], events: list[tuple[int, str]]) -> None:
    points = np.array(loaded, bool)[:, None]
    assert Flights(least=2).add(np.arange(4), points) == events
    one_by_one = Flights(least=2)
    found = [one_by_one.add(np.array([tick]), points[tick : tick + 1]) for tick in range(4)]
    assert [event for some in found for event in some] == events


@pytest.mark.parametrize("direction", [(0, 0, 2), (0, 0, -3), (1, 0, 0), (-1, 2, -0.5)])
def test_capsules_are_turned_the_shortest_way(direction: tuple[float, float, float]) -> None:
    quaternion = quaternion_from_z(np.array(direction, float))
    (rotation,) = matrices_of_quaternions(quaternion[None])
    unit = np.array(direction) / np.linalg.norm(direction)
    np.testing.assert_allclose(rotation @ [0, 0, 1], unit, atol=1e-12)


def test_elements_are_called_what_they_are() -> None:
    robot = hopper_description()

    def names(name: str, shape: tuple[int, ...], *dimensions: int | str) -> list[str]:
        return element_names(RecordedField(name, "float64", 0, shape, dimensions), robot)

    assert names("joint_position", (2,), "n_joints") == ["hip", "knee"]
    assert names("motor_torque", (2,), "n_joints") == ["a", "b"]
    assert names("com", (3,), 3) == ["x", "y", "z"]
    assert names("robot.truth.stage", ()) == ["stage"]
    forces = names("contact_force", (2, 3), "n_contacts", 3)
    assert forces == ["toe x", "toe y", "toe z", "heel x", "heel y", "heel z"]
    assert names("matrix", (30, 30), "n", "n") == []
