"""A motion's file, read back: the robot's poses, the series with their names, the events."""

from pathlib import Path

import numpy as np
import pytest

from aloft.logs.recording.motion_recording import MotionRecording, write_motion
from aloft.robots.description import find_robot


def motion(count: int = 5) -> MotionRecording:
    robot = find_robot("bruce")
    height = np.linspace(0.3, 0.4, count)
    return MotionRecording(
        robot,
        np.arange(count) * 0.01,
        np.column_stack([0 * height, 0 * height, height]),
        np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        np.tile(robot.standing_position, (count, 1)),
        np.column_stack([0 * height, 0 * height, height - 0.05]),
        np.zeros((count, 4, 3)),
        np.full((count, 4, 3), 10.0),
        {"base height [m]": (height[:, None], ["base"])},
        [(0.02, "lift-off")],
        {"task": "hop"},
    )


def entities(path: Path) -> dict[str, list[object]]:
    from rerun.chunk import RrdReader

    found: dict[str, list[object]] = {}
    for chunk in RrdReader(str(path)).stream():
        if not chunk.is_static:
            found.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch())
    return found


def test_what_was_written_comes_back(tmp_path: Path) -> None:
    path = write_motion(tmp_path / "folder" / "hop.rrd", motion(), "hop")
    found = entities(path)
    assert {f"/world/robot/{link.name}" for link in find_robot("bruce").links} <= set(found)
    assert {"/world/com", "/world/contact_forces", "/events"} <= set(found)
    batch = found["/series/base_height"][0]
    values = batch["Scalars:scalars"].flatten().to_numpy()
    np.testing.assert_array_equal(values, np.linspace(0.3, 0.4, 5))
    times = batch["t"].cast("int64").to_numpy()
    np.testing.assert_array_equal(times, np.arange(5) * 10_000_000)
    assert found["/events"][0]["TextLog:text"].to_pylist() == [["lift-off"]]


def test_a_place_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError):
        write_motion(tmp_path / "file" / "hop.rrd", motion(), "hop")
