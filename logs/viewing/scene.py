"""Draws the robot in 3D: the robot itself, contacts, motion, plan, push and ground.

The true robot is solid, as meshes where its description has them. The estimated one is drawn as wires
around it, which are those of the collision shapes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.rotations import quaternions_of_matrices
from ...robots.surfaces import robot_surfaces
from ...robots.terrain import Ground, HeightField
from ..file.format import EVENTS, WORLD, Header, RecordedRows, time_columns, timed
from .contacts import (
    ABOVE_GROUND,
    AFTER_TOUCHDOWN,
    ARROW_RADIUS,
    SHORTEST_FLIGHT,
    TOUCHDOWN,
    ContactDisplay,
    Flights,
    FootForces,
    LandingPeaks,
    force_arrows,
    thruster_forces,
)
from .drawing import Colors, Detail, Moments, SceneDisplay
from .robot_shapes import drawn_link, drawn_shapes, eye_height, shapes_of
from .scene_ports import PoseSource, ScenePorts
from .scene_sensors import SensorDisplay

EYE = "eye"
"""The entity below ``world`` that the camera follows."""


class RobotDisplay(SceneDisplay):
    """``robot/<link>`` and ``estimate/<link>``: the shapes once, then one pose for each instant.

    The shapes come after the first poses, because a viewer that is still loading would else show
    all links at the origin. ``eye`` is a point that goes along with the base, which the camera
    follows; it does not rise, so that a jump is seen as one.
    """

    _shown = False

    def write(self, moments: Moments) -> None:
        """Write where the links are, and in the first call their shapes, too."""
        import rerun as rr

        for name, source, _ in self._robots():
            poses = moments.poses(self.robot, source)
            for link in self.robot.links:
                position, rotation = poses.of(link.name)
                turn = quaternions_of_matrices(rotation)
                transforms = rr.Transform3D.columns(translation=position, quaternion=turn)
                self.send(f"{name}/{link.name}", moments, transforms)
            if name == "robot":
                beside = poses.of(self.robot.base)[0].copy()
                beside[:, 2] = eye_height(self.robot)
                self.send(EYE, moments, rr.Transform3D.columns(translation=beside))
        if not self._shown:
            self._shown = True
            self._write_shapes(moments)

    def _write_shapes(self, moments: Moments) -> None:
        import rerun as rr

        surfaces = robot_surfaces(self.robot)

        self.log(EYE, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.0], colors=[0x00000000]))
        width = 0.0006 * self.scale
        for name, _, color in self._robots():
            for link in self.robot.links:
                entity = f"{name}/{link.name}"
                if name == "estimate":
                    shapes = shapes_of(self.robot, link)
                    parts = drawn_shapes(shapes, color, wires=True, line_radius=width)
                else:
                    parts = drawn_link(
                        self.robot, link, surfaces, color, width, own_colors=color == Colors.robot
                    )
                for below, drawn in parts.items():
                    self.log(f"{entity}{below}", drawn)
        if problems := surfaces.problems:
            texts = rr.TextLog.columns(text=problems, level=["WARN"] * len(problems))
            ticks = np.full(len(problems), moments.batch.ticks[moments.due[0]])
            root = self.world.removesuffix(WORLD)
            self.stream.send_columns(f"{root}{EVENTS}", time_columns(self.header, ticks), texts)

    def _robots(self) -> list[tuple[str, PoseSource, int]]:
        robots = [("robot", self.ports.pose, self.colors.robot)]
        if self.ports.estimate is not None and self.detail.extras:
            robots.append(("estimate", self.ports.estimate, self.colors.estimate))
        return robots


class MassCentreDisplay(SceneDisplay):
    """``com``: a ball; ``com_projection``: the plumb line to the ground below it."""

    def write_static(self) -> None:
        """Write colours and sizes."""
        import rerun as rr

        if self.ports.com is not None:
            ball = rr.Points3D.from_fields(colors=[self.colors.com], radii=[0.012 * self.scale])
            self.log("com", ball)
            line = rr.LineStrips3D.from_fields(
                colors=[self.colors.com], radii=[0.0015 * self.scale]
            )
            self.log("com_projection", line)

    def write(self, moments: Moments) -> None:
        """Write where the centre of mass is."""
        import rerun as rr

        if self.ports.com is None:
            return
        com = moments[self.ports.com]
        self.send("com", moments, rr.Points3D.columns(positions=com))
        foot = com.copy()
        foot[:, 2] = ABOVE_GROUND
        if self.ports.ground_height is not None and self.robot.contacts:
            foot[:, 2] += moments[self.ports.ground_height].min(axis=1)
        # a small cross on the ground at the end of the line
        ways = [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 0], [0, 1, 0], [0, -1, 0]]
        arm = 0.02 * self.scale * np.array(ways)
        lines = np.concatenate([com[:, None], foot[:, None] + arm], axis=1)
        columns = rr.LineStrips3D.columns(strips=list(lines))
        self.send("com_projection", moments, columns)


class PlanDisplay(SceneDisplay):
    """``plan/com`` and ``plan/<foot>``: the planned motion, placed where the robot stood at first.

    The positions of a plan are relative to where the robot stands before. Here that is the middle
    of its contact points in the first tick that is written.
    """

    _start: Array | None = None

    def write_static(self) -> None:
        """Write the feet's outlines."""
        import rerun as rr

        if self.ports.plan is None:
            return
        ball = rr.Points3D.from_fields(colors=[self.colors.plan], radii=[0.009 * self.scale])
        self.log("plan/com", ball)
        for k, foot in enumerate(self.robot.feet):
            self.log(f"plan/{foot.name}", foot_outline(self, k, self.colors.plan))

    def write(self, moments: Moments) -> None:
        """Write where the plan is at these instants."""
        import rerun as rr

        plan = self.ports.plan
        if plan is None:
            return
        com, feet = moments[f"{plan}.com"], moments[f"{plan}.foot_position"]
        start = self._stood(moments)
        self.send("plan/com", moments, rr.Points3D.columns(positions=com + start))
        yaw = moments[f"{plan}.foot_yaw"]
        for k, foot in enumerate(self.robot.feet):
            some = self.changing(f"plan/{foot.name}", moments, feet[:, k], yaw[:, k])
            if not len(some):
                continue
            half, nothing = 0.5 * some[f"{plan}.foot_yaw"][:, k], np.zeros(len(some))
            turn = np.column_stack([nothing, nothing, np.sin(half), np.cos(half)])
            places = some[f"{plan}.foot_position"][:, k] + start
            poses = rr.Transform3D.columns(translation=places, quaternion=turn)
            self.send(f"plan/{foot.name}", some, poses)

    def _stood(self, moments: Moments) -> Array:
        if self._start is None:
            self._start = np.zeros(3)
            if self.ports.contact_position is not None:
                contacts = moments.batch.signal(self.ports.contact_position)[0]
                planned = moments.batch.signal(f"{self.ports.plan}.foot_position")[0]
                feet = self.robot.foot_of_contact()
                middles = [
                    contacts[[foot == k for foot in feet]].mean(axis=0) for k in sorted({*feet})
                ]
                self._start = np.mean(middles, axis=0) - planned.mean(axis=0)
        return self._start


class FootTargetDisplay(SceneDisplay):
    """``foot_targets/<foot>``: where the controller wants the feet, seen from the base it knows."""

    def write_static(self) -> None:
        """Write the feet's outlines."""
        if self.ports.feet is not None:
            for k, foot in enumerate(self.robot.feet):
                self.log(f"foot_targets/{foot.name}", foot_outline(self, k, self.colors.target))

    def write(self, moments: Moments) -> None:
        """Write where the controller wants the feet."""
        import rerun as rr

        if self.ports.feet is None:
            return
        source = self.ports.estimate or self.ports.pose
        base, turn = moments.poses(self.robot, source).of(self.robot.base)
        position = moments[f"{self.ports.feet}.position"]
        rotation = moments[f"{self.ports.feet}.rotation"]
        for k, foot in enumerate(self.robot.feet):
            there = base + np.einsum("nij,nj->ni", turn, position[:, k])
            way = quaternions_of_matrices(turn @ rotation[:, k])
            columns = rr.Transform3D.columns(translation=there, quaternion=way)
            self.send(f"foot_targets/{foot.name}", moments, columns)


def foot_outline(display: SceneDisplay, foot: int, color: int) -> object:
    """Make the outline of a sole in its own frame: a box around its contact points and their
    radius.

    The outline of a point foot is a square as wide as the foot.
    """
    import rerun as rr

    robot = display.robot
    contacts = [c for c in robot.contacts if c.foot == robot.feet[foot].name]
    points = np.array([c.position for c in contacts]).reshape(-1, 3) - robot.feet[foot].sole
    radius = max([c.radius for c in contacts], default=0.01)
    low = points.min(axis=0, initial=0.0) - np.array([radius, radius, 0.0])
    high = points.max(axis=0, initial=0.0) + np.array([radius, radius, 0.0])
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    strip = [(x, y, ABOVE_GROUND) for x, y in [*corners, corners[0]]]
    return rr.LineStrips3D([strip], colors=[color], radii=[0.0015 * display.scale])


class ThrustDisplay(SceneDisplay):
    """``thrust``: an arrow for the force of every thruster on its link."""

    def write_static(self) -> None:
        """Write the colour."""
        import rerun as rr

        if self.ports.thrust is not None:
            width = ARROW_RADIUS * self.scale
            self.log("thrust", rr.Arrows3D.from_fields(colors=[self.colors.support], radii=[width]))

    def write(self, moments: Moments) -> None:
        """Write the forces where they act."""
        import rerun as rr

        if self.ports.thrust is None or not len(moments):
            return
        poses = moments.poses(self.robot, self.ports.pose)
        places, forces = thruster_forces(self.robot, poses, moments[self.ports.thrust])
        vectors = force_arrows(self.robot, forces)
        arrows = rr.Arrows3D.columns(origins=places.reshape(-1, 3), vectors=vectors.reshape(-1, 3))
        self.send("thrust", moments, arrows.partition(np.full(len(moments), places.shape[1])))


class PushDisplay(SceneDisplay):
    """``push``: an arrow at the robot's named point, of length zero except during the push."""

    def write_static(self) -> None:
        """Write the colour."""
        import rerun as rr

        if self.ports.push is not None:
            width = 1.5 * ARROW_RADIUS * self.scale
            self.log("push", rr.Arrows3D.from_fields(colors=[self.colors.push], radii=[width]))

    def write(self, moments: Moments) -> None:
        """Write the force where it acts."""
        import rerun as rr

        names = list(self.robot.points)
        if self.ports.push is None or not names:
            return
        moments = self._acting(moments)
        if not len(moments):
            return
        force = force_arrows(self.robot, moments[f"{self.ports.push}.force"])
        point = np.clip(moments[f"{self.ports.push}.point"], 0, len(names) - 1)
        poses = moments.poses(self.robot, self.ports.pose)
        ends = np.zeros((len(names), len(moments), 3))
        for k, (link, place) in enumerate(self.robot.points.values()):
            position, rotation = poses.of(link)
            ends[k] = position + rotation @ np.array(place)
        there = ends[point, np.arange(len(moments))]
        arrows = rr.Arrows3D.columns(origins=there - force, vectors=force)
        self.send("push", moments, arrows)

    def _acting(self, moments: Moments) -> Moments:
        """Return the instants at which it acts, and the first one and those at which it has just
        ended."""
        acts = (moments[f"{self.ports.push}.force"] != 0.0).any(axis=1)
        return self.changing("push", moments, acts * moments.batch.ticks[moments.due])


COLOR = 0x8D9299FF
SLIPPERY = 0x5B8DB8FF
"""The colour of ground with a friction coefficient of 0.3."""
EDGES = 0xCFD8DCFF
"""The edges of the boxes: all their sides have one colour, so a step would not be seen without."""
FLOOR_SIZE = 4.0
"""Length and width of the piece of floor that is drawn [m]."""
FLOOR_THICKNESS = 0.02
DEEPEST_FLOOR = -10.0
"""A floor below this height [m] is out of reach, and so not drawn."""


def color_of_ground(friction: float | None) -> int:
    """Return the colour of a piece of ground, as 0xRRGGBBAA."""
    if friction is None:
        return COLOR
    share = min(max((friction - 0.3) / 0.7, 0.0), 1.0)
    channels = ((COLOR >> shift & 0xFF, SLIPPERY >> shift & 0xFF) for shift in (24, 16, 8, 0))
    mixed = [round(share * rough + (1.0 - share) * smooth) for rough, smooth in channels]
    return int.from_bytes(bytes(mixed))


def _normals(field: HeightField) -> NDArray[np.float64]:
    """Return the normals at a field's corners, for its shading, (n, 3)."""
    heights = np.array(field.heights)
    rows, columns = heights.shape
    x, y = ((field.most[k] - field.least[k]) / (n - 1) for k, n in enumerate((columns, rows)))
    left, ahead = np.gradient(heights, y, x)
    normals = np.stack([-ahead, -left, np.ones_like(heights)], axis=-1).reshape(-1, 3)
    unit: NDArray[np.float64] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return unit


class TerrainDisplay(SceneDisplay):
    """``ground``: the boxes of the scene with their edges, and its height fields, drawn once. What is more
    slippery is bluer. A level floor at height zero is not drawn, as the viewer has a grid there."""

    def write_static(self) -> None:
        """Write the boxes and the fields."""
        terrain = self.header.terrain
        if terrain is None:
            return
        blocks = list(terrain.blocks)
        if DEEPEST_FLOOR < terrain.floor < 0.0:
            half, bottom = 0.5 * FLOOR_SIZE, terrain.floor - FLOOR_THICKNESS
            blocks.append(Ground((-half, -half, bottom), (half, half, terrain.floor)))
        if blocks:
            self._write_boxes(blocks)
        for k, field in enumerate(terrain.fields):
            self._write_field(f"ground/field/{k}", field)

    def _write_boxes(self, blocks: list[Ground]) -> None:
        import rerun as rr

        colors = np.array([color_of_ground(block.friction) for block in blocks], np.uint32)
        for name, color, mode in (
            ("ground", colors, "solid"),
            ("ground/edges", np.full(len(blocks), EDGES, np.uint32), "majorwireframe"),
        ):
            boxes = rr.Boxes3D(
                centers=[block.middle for block in blocks],
                half_sizes=[block.half_sizes for block in blocks],
                quaternions=None
                if all(block.level for block in blocks)
                else [rr.Quaternion(xyzw=block.quaternion) for block in blocks],
                colors=color,
                radii=np.full(len(blocks), 0.003 * self.scale),
                fill_mode=mode,
            )
            self.log(name, boxes)

    def _write_field(self, name: str, field: HeightField) -> None:
        import rerun as rr

        corners, triangles = field.triangles()
        color = color_of_ground(field.friction)
        mesh = rr.Mesh3D(
            vertex_positions=corners, triangle_indices=triangles, vertex_normals=_normals(field),
            vertex_colors=np.full(len(corners), color, np.uint32),
        )  # fmt: skip
        self.log(name, mesh)

    def write(self, moments: Moments) -> None:
        """Write nothing: the ground does not move."""


DISPLAYS = (
    TerrainDisplay,
    RobotDisplay,
    ContactDisplay,
    MassCentreDisplay,
    PlanDisplay,
    FootTargetDisplay,
    PushDisplay,
    ThrustDisplay,
    SensorDisplay,
)


class SceneWriter:
    """Writes the scene to a Rerun ``stream``, batch by batch, below ``root``."""

    def __init__(
        self,
        stream: Any,
        header: Header,
        ports: ScenePorts,
        root: str,
        colors: Colors,
        detail: Detail,
    ) -> None:
        self._stream, self._header, self._ports = stream, header, ports
        self._root = root
        self._every = max(1, round(header.base_rate / detail.picture_rate))
        self._displays = [
            display(stream, header, ports, f"{root}world", colors, detail) for display in DISPLAYS
        ]
        self._flights = Flights(max(1, round(SHORTEST_FLIGHT * header.base_rate)))
        self._loads = self._peaks = None
        if ports.contact_force is not None and header.robot is not None and header.robot.feet:
            self._loads = FootForces(stream, header, ports.contact_force, root, detail.picker())
            after = max(1, round(AFTER_TOUCHDOWN * header.base_rate))
            self._peaks = LandingPeaks(header.robot, after)

    def write_static(self) -> None:
        """Write everything that does not move."""
        import rerun as rr

        self._stream.log(f"{self._root}world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for display in self._displays:
            display.write_static()
        if self._loads is not None:
            self._loads.write_static()

    def write(self, batch: RecordedRows) -> None:
        """Write the instants of a batch that are drawn, and the flights that begin or end in it."""
        due = np.flatnonzero(batch.ticks % self._every == 0)
        if len(due):
            moments = Moments(batch, due, time_columns(self._header, batch.ticks[due]))
            for display in self._displays:
                display.write(moments)
        if self._loads is not None:
            self._loads.write(batch)
        self._write_flights(batch)

    def write_rest(self) -> None:
        """Write the last forces on the feet, if they were constant in the end."""
        if self._loads is not None:
            self._loads.write_rest()

    def _write_flights(self, batch: RecordedRows) -> None:
        import rerun as rr

        if self._ports.contact_force is None:
            return
        force = batch.signal(self._ports.contact_force)
        events = self._flights.add(batch.ticks, (force != 0.0).any(axis=2))
        if self._peaks is not None:
            touchdowns = [tick for tick, text in events if text == TOUCHDOWN]
            events = sorted(events + self._peaks.add(batch.ticks, force, touchdowns))
        if events:
            ticks = np.array([tick for tick, _ in events])
            times = time_columns(self._header, ticks)
            texts = timed(self._header, ticks, [text for _, text in events])
            columns = rr.TextLog.columns(text=texts, level=["INFO"] * len(texts))
            self._stream.send_columns(f"{self._root}{EVENTS}", times, columns)
