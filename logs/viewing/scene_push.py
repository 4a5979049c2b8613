"""The push from outside, as an arrow that ends where it acts."""

from __future__ import annotations

import numpy as np

from .scene_contacts import ARROW_RADIUS, force_arrows
from .scene_part import Moments, ScenePart


class PushPart(ScenePart):
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
        """The instants at which it acts, and the first one and those at which it has just ended."""
        acts = (moments[f"{self.ports.push}.force"] != 0.0).any(axis=1)
        return self.changing("push", moments, acts * moments.batch.ticks[moments.due])
