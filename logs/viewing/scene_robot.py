"""The robot in the scene: the true one solid, the estimated one as wires around it."""

from __future__ import annotations

from ...robots.kinematics import quaternions_of_matrices
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
            self._write_shapes()

    def _write_shapes(self) -> None:
        import rerun as rr

        self.log(EYE, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.0], colors=[0x00000000]))
        for name, _, color in self._robots():
            for link in self.robot.links:
                shapes = shapes_of(self.robot, link)
                width = 0.0006 * self.scale
                drawn = capsules(shapes, color, wires=name == "estimate", line_radius=width)
                self.log(f"{name}/{link.name}", drawn)

    def _robots(self) -> list[tuple[str, PoseSource, int]]:
        robots = [("robot", self.ports.pose, self.colors.robot)]
        if self.ports.estimate is not None and self.detail.extras:
            robots.append(("estimate", self.ports.estimate, self.colors.estimate))
        return robots
