"""Plans a squat jump from a few numbers and plays it back as the reference of other blocks."""

from __future__ import annotations

from functools import lru_cache

from ...planner.library.jump_table import JumpTable
from ...robots.description import RobotDescription
from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.parameters import parameter
from .guided_reference import GuidedParameters, GuidedReference
from .squat_jump import SquatJumpTask, plan_squat_jump


class SquatJumpReference(GuidedReference):
    """A squat, thrust, flight and landing of the whole body, planned from a few numbers.

    It serves any robot whose feet stand level in its standing pose and that has joints enough to
    move its centre of mass and base with all feet on the ground: bipeds with line or flat feet,
    quadrupeds with point feet. The defaults are BRUCE's.

    The take-off speed is that of a ballistic rise, V^2 = 2 g (rise + lift_off_drop); the thrust
    goes from the squat's bottom to lift-off with, over u from 0 to 1 in its time T,

        v(u) = V (3 u^2 - 2 u^3) - unloading g T (u^3 - u^2),

    so that it begins without a jerk and ends with nearly unloaded feet. All joints follow from
    the feet, the centre of mass and the pitching momentum (see ``guided_motion``); the momentum
    at lift-off is solved for so that the torso touches down at ``touchdown_pitch``. Leaving the
    ground early, well before the legs are straight and with the torso still leaning, is what
    keeps the hips slow: their speed, not torque, limits the height.

    Torque follows its command with a delay, so acceleration and the rate of angular momentum, which
    are fed forward, are published ``lead`` ahead of time.

    The plan is made at load (about 0.2 s) and read by the time since the run began; after its end
    the reference stands still. The block knows nothing of what the robot really does, plans no
    lateral jump and no twist, and leaves forces and torque limits to the controller. The load
    report names a robot with too few joints; ``setup`` raises ``BlockError`` where a joint would
    exceed its limit or a motor its speed.
    """

    class Params(GuidedParameters):
        rise: float = parameter(
            0.09, unit="m", gt=0.0, le=1.0, text="apex of the centre of mass above standing"
        )
        distance: float = parameter(
            0.0, unit="m", ge=-1.0, le=1.0, text="how far ahead of the start the feet land"
        )
        lean: float = parameter(
            0.8, unit="rad", ge=0.0, le=1.3, text="forward pitch of the torso in the squat"
        )
        touchdown_pitch: float = parameter(
            -0.06, unit="rad", ge=-0.5, le=0.5, text="forward pitch of the torso at touchdown"
        )
        squat_depth: float = parameter(
            0.094, unit="m", gt=0.0, le=0.5, text="bottom of the squat below standing"
        )
        lift_off_drop: float = parameter(
            0.029, unit="m", ge=-0.1, le=0.3, text="height at lift-off below standing"
        )
        touchdown_drop: float = parameter(
            0.009, unit="m", ge=-0.1, le=0.3, text="height at touchdown below standing"
        )
        landing_depth: float = parameter(
            0.06, unit="m", ge=0.0, le=0.5, text="where the landing comes to rest below standing"
        )
        unloading: float = parameter(
            0.7, ge=0.0, le=1.0, text="share of the weight taken off the feet at lift-off"
        )
        settle_time: float = parameter(
            0.1, unit="s", gt=0.02, le=0.5, text="from lift-off to the legs' landing posture"
        )
        stand_time: float = parameter(
            0.4, unit="s", gt=0.0, text="standing, for the estimator to settle"
        )
        squat_time: float = parameter(0.5, unit="s", gt=0.1, text="going down")
        pause_time: float = parameter(0.15, unit="s", gt=0.0, text="waiting at the bottom")
        landing_time: float = parameter(0.35, unit="s", gt=0.05, text="coming to rest")
        recover_time: float = parameter(0.6, unit="s", gt=0.05, text="rising to standing")

    params: Params

    def make_table(self) -> JumpTable:
        """The squat, the jump and the landing."""
        robot, p = self.robot, self.params
        names = set(SquatJumpTask.__dataclass_fields__)
        task = SquatJumpTask(**{k: v for k, v in p.model_dump().items() if k in names})
        return _plan(robot.model_dump_json(), task)

    def step(self) -> None:
        self._reader.read(self.time + float(self.delay.ahead), self.params.lead, self.period)


@lru_cache(maxsize=8)
def _plan(robot: str, task: SquatJumpTask) -> JumpTable:
    """The plan for a robot given as JSON; it is computed once for all runs of a process."""
    description = RobotDescription.model_validate_json(robot)
    return plan_squat_jump(build_pinocchio_model(description), description, task)
