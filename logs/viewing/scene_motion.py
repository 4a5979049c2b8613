"""Draws the centre of mass, the plan for it and for the feet, and the controller's foot targets."""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...robots.kinematics import quaternions_of_matrices
from .scene_contacts import ABOVE_GROUND
from .scene_part import Moments, ScenePart


class MassCentrePart(ScenePart):
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


class PlanPart(ScenePart):
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


class FootTargetPart(ScenePart):
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


def foot_outline(part: ScenePart, foot: int, color: int) -> object:
    """The outline of a sole in its own frame: a box around its contact points and their radius.

    The outline of a point foot is a square as wide as the foot.
    """
    import rerun as rr

    robot = part.robot
    contacts = [c for c in robot.contacts if c.foot == robot.feet[foot].name]
    points = np.array([c.position for c in contacts]).reshape(-1, 3) - robot.feet[foot].sole
    radius = max([c.radius for c in contacts], default=0.01)
    low = points.min(axis=0, initial=0.0) - np.array([radius, radius, 0.0])
    high = points.max(axis=0, initial=0.0) + np.array([radius, radius, 0.0])
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    strip = [(x, y, ABOVE_GROUND) for x, y in [*corners, corners[0]]]
    return rr.LineStrips3D([strip], colors=[color], radii=[0.0015 * part.scale])
