"""The task for the position of a frame of the robot, such as a hand."""

from __future__ import annotations

from collections.abc import Iterable

from ....mathematics.kernel import kernel
from ....robots.description import RobotDescription
from ....runtime.language.block import Input
from ....runtime.language.parameters import parameter
from ...signals import PointTarget
from ..frames import Frame, frames_of
from .task import FeedbackGains, FeedbackTask, TaskError, TaskJacobian

Vector = tuple[float, float, float]


class FramePosition(FeedbackTask):
    """The origin of a frame accelerates by r'' + K_p (r - x) + K_d (r' - x') towards its target r.

    The rows are those of the frame's Jacobian for its origin, in m/s^2 along the axes of the world.
    """

    class Params(FeedbackGains):
        frame: str = parameter(text="name of a link, a named point or a contact point")
        offset: Vector = parameter((0.0, 0.0, 0.0), unit="m", text="the point's place in the frame")

    params: Params
    size = 3
    target = Input(PointTarget, text="target of the frame's place and motion")

    @classmethod
    def unmet_requirements(cls, params: Params, robot: RobotDescription) -> Iterable[str]:
        if params.frame not in frames_of(robot):
            yield f"{robot.name} has no frame {params.frame!r}; it has {', '.join(frames_of(robot))}"

    def setup(self) -> None:
        self.frame = self.model.frame(self.params.frame, self.params.offset)

    @kernel
    @staticmethod
    def error(frame: Frame, target: PointTarget, e: TaskError) -> None:
        e.value[:] = target.position - frame.position
        e.rate[:] = target.velocity - frame.velocity[0:3]
        e.feedforward[:] = target.acceleration

    @kernel
    @staticmethod
    def jacobian(frame: Frame, j: TaskJacobian) -> None:
        j.matrix[:, :] = frame.jacobian[0:3, :]
        j.drift[:] = frame.drift[0:3]
