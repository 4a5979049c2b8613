"""The robot in the scene: the true one solid, as meshes where its description has them, and the
estimated one as wires around it, which are always those of the collision shapes."""

from __future__ import annotations

import numpy as np

from ...robots.kinematics import quaternions_of_matrices
from ..file.format import EVENTS, WORLD
from ..file.time_columns import time_columns
from .robot_meshes import drawn_link, read_meshes
from .robot_shapes import capsules, eye_height, shapes_of
from .scene_part import Moments, ScenePart
from .scene_ports import PoseSource

EYE = "eye"
"""The entity below ``world`` that the camera follows."""


class RobotPart(ScenePart):
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

        meshes = read_meshes(self.robot)

        self.log(EYE, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.0], colors=[0x00000000]))
        width = 0.0006 * self.scale
        for name, _, color in self._robots():
            for link in self.robot.links:
                entity = f"{name}/{link.name}"
                if name == "estimate":
                    shapes = shapes_of(self.robot, link)
                    self.log(entity, capsules(shapes, color, wires=True, line_radius=width))
                    continue
                for below, drawn in drawn_link(self.robot, link, meshes, color, width).items():
                    self.log(f"{entity}{below}", drawn)
        if meshes.problems:
            texts = rr.TextLog.columns(text=meshes.problems, level=["WARN"] * len(meshes.problems))
            ticks = np.full(len(meshes.problems), moments.batch.ticks[moments.due[0]])
            root = self.world.removesuffix(WORLD)
            self.stream.send_columns(f"{root}{EVENTS}", time_columns(self.header, ticks), texts)

    def _robots(self) -> list[tuple[str, PoseSource, int]]:
        robots = [("robot", self.ports.pose, self.colors.robot)]
        if self.ports.estimate is not None and self.detail.extras:
            robots.append(("estimate", self.ports.estimate, self.colors.estimate))
        return robots
