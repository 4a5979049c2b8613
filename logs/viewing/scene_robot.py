"""The robot in the scene: the true one solid, the estimated one as wires around it."""

from __future__ import annotations

from .robot_shapes import capsules, shapes_of
from .scene_part import Moments, ScenePart
from .scene_ports import PoseSource


class RobotPart(ScenePart):
    """``robot/<link>`` and ``estimate/<link>``: the shapes once, then one pose for each instant."""

    def write_static(self) -> None:
        """Write the links' shapes."""
        for name, _, color in self._robots():
            for link in self.robot.links:
                wires = name == "estimate"
                self.log(
                    f"{name}/{link.name}",
                    capsules(shapes_of(self.robot, link), color, wires=wires),
                )

    def write(self, moments: Moments) -> None:
        """Write where the links are."""
        import rerun as rr

        for name, source, _ in self._robots():
            poses = moments.poses(self.robot, source)
            for link in self.robot.links:
                position, rotation = poses.of(link.name)
                transforms = rr.Transform3D.columns(translation=position, mat3x3=rotation)
                self.send(f"{name}/{link.name}", moments, transforms)

    def _robots(self) -> list[tuple[str, PoseSource, int]]:
        robots = [("robot", self.ports.pose, self.colors.robot)]
        if self.ports.estimate is not None:
            robots.append(("estimate", self.ports.estimate, self.colors.estimate))
        return robots
