"""Writes a motion that has not been run, such as a plan, into one Rerun file.

The file has the robot in 3D at 100 Hz with contact forces and centre of mass (``world``), as in the
recording of a run, and time series with legends (``series/<title>``), on the timeline ``t``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ...robots.surfaces import robot_surfaces
from ..viewing.contacts import ARROW_RADIUS, force_arrows
from ..viewing.drawing import Colors, opened_stream
from ..viewing.robot_shapes import drawn_link, eye_controls, scale_of

COLORS = Colors()


@dataclass(frozen=True)
class MotionRecording:
    """A motion at ``n`` instants.

    Attributes:
        robot: the robot that moves.
        time: increasing [s], (n,).
        base_position, base_orientation, joint_position: where the links are.
        com: centre of mass [m], (n, 3).
        contact_position, contact_force: [m] and [N], (n, n_contacts, 3).
        series: by title with unit, e.g. ``foot height [m]``, what else to plot, (n, m), and the
            names of its m lines.
        events: (time [s], text).
        properties: what the file is about, as texts.
    """

    robot: RobotDescription
    time: Array
    base_position: Array
    base_orientation: Array
    joint_position: Array
    com: Array
    contact_position: Array
    contact_force: Array
    series: Mapping[str, tuple[Array, Sequence[str]]] = field(default_factory=dict)
    events: Sequence[tuple[float, str]] = ()
    properties: Mapping[str, str] = field(default_factory=dict)


def write_motion(path: str | Path, motion: MotionRecording, name: str) -> Path:
    """Write the file, replacing an older one.

    Raises:
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """
    import rerun as rr

    path = Path(path)
    with opened_stream(path, name, motion_blueprint(motion)) as stream:
        stream.send_property("aloft", rr.AnyValues(**motion.properties))
        _write_world(stream, motion)
        for title, (values, names) in motion.series.items():
            entity = series_entity(title)
            stream.log(entity, rr.SeriesLines(names=list(names)), static=True)
            stream.send_columns(
                entity, _times(motion.time), rr.Scalars.columns(scalars=values)
            )  # fmt: skip
        if motion.events:
            times, texts = zip(*motion.events, strict=True)
            columns = rr.TextLog.columns(text=list(texts), level=["INFO"] * len(texts))
            stream.send_columns("events", _times(np.array(times)), columns)
    return path


def series_entity(title: str) -> str:
    """Return the entity of a series: ``foot height [m]`` is in ``series/foot_height``."""
    return f"series/{title.partition(' [')[0].replace(' ', '_')}"


def motion_blueprint(motion: MotionRecording) -> Any:
    """Lay out the robot on the left, every series on the right."""
    import rerun.blueprint as rrb

    scene = rrb.Spatial3DView(
        origin="world",
        name="Robot",
        eye_controls=eye_controls(motion.robot, 1.5),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )
    plots = [rrb.TimeSeriesView(origin=series_entity(title), name=title) for title in motion.series]
    column = rrb.Vertical(*plots, rrb.TextLogView(origin="events", name="Events"))
    return rrb.Blueprint(
        rrb.Horizontal(scene, column, column_shares=[2, 3]),
        rrb.TimePanel(state="collapsed", timeline="t"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _times(time: Array) -> list[Any]:
    import rerun as rr

    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn("t", duration=nanoseconds)]


def _write_world(stream: Any, motion: MotionRecording) -> None:
    """Write the links, the forces and the centre of mass."""
    import rerun as rr

    robot, times = motion.robot, _times(motion.time)
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    poses = link_poses(
        robot, motion.base_position, motion.base_orientation, motion.joint_position
    )  # fmt: skip
    surfaces = robot_surfaces(robot)
    for link in robot.links:
        entity = f"world/robot/{link.name}"
        for below, drawn in drawn_link(robot, link, surfaces, COLORS.robot).items():
            stream.log(f"{entity}{below}", drawn, static=True)
        position, rotation = poses.of(link.name)
        transforms = rr.Transform3D.columns(translation=position, mat3x3=rotation)
        stream.send_columns(entity, times, transforms)
    forces, count = force_arrows(robot, motion.contact_force), len(robot.contacts)
    scale = scale_of(robot)
    looks = rr.Arrows3D.from_fields(colors=[COLORS.force], radii=[ARROW_RADIUS * scale])
    stream.log("world/contact_forces", looks, static=True)
    arrows = rr.Arrows3D.columns(
        origins=motion.contact_position.reshape(-1, 3), vectors=forces.reshape(-1, 3)
    )
    stream.send_columns("world/contact_forces", times, arrows.partition([count] * len(forces)))
    point = rr.Points3D.from_fields(colors=[COLORS.com], radii=[0.012 * scale])
    stream.log("world/com", point, static=True)
    stream.send_columns("world/com", times, rr.Points3D.columns(positions=motion.com))
    way = rr.LineStrips3D([motion.com], colors=[COLORS.com], radii=[0.002 * scale])
    stream.log("world/com_path", way, static=True)
