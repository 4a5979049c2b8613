"""What motors give of a request, and what must be asked of them, by torque constant, saturation and load."""

from __future__ import annotations

import math

import numpy as np

from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import JointCommand, JointState

_ITERATIONS = 8
_STEEPEST = 1.0 / 3.0
"""From this saturation on more current would give less torque."""


class MotorModelParameters(Parameters):
    """The parameters of ``MotorModel``, each by the name of the motor's joint."""

    torque_constant: PerJoint = live_parameter(
        PerJoint(1.0), gt=0.0, text="factor on the torque constant in the description"
    )
    saturation: PerJoint = live_parameter(
        PerJoint(0.0), ge=0.0, lt=_STEEPEST,
        text="share of the torque that is missing at the peak torque; it grows with its square",
    )  # fmt: skip
    load_friction: PerJoint = live_parameter(
        PerJoint(0.0), ge=0.0, lt=1.0, text="share of the torque that the gear loses under load"
    )
    load_speed: float = live_parameter(
        0.3, unit="rad/s", gt=0.0, text="motor speed at which most of it is lost"
    )


class MotorModelConstants(Signal):
    """The motors, and what maps joints to them."""

    to_motor = Field(("n_joints", "n_joints"), text="motor speeds from joint speeds")
    torque_to_motor = Field(("n_joints", "n_joints"), text="motor torques from joint torques")
    torque_to_joint = Field(("n_joints", "n_joints"), text="joint torques from motor torques")
    peak = Field("n_joints", unit="N m", text="peak torque of each motor; 0: the joint has none")
    torque_constant = Field("n_joints", text="factor on the torque constant")
    saturation = Field("n_joints", text="share of the torque missing at the peak")
    load_friction = Field("n_joints", text="share of the torque lost under load")


class MotorModelScratch(Signal):
    """Torque and speed of the motors."""

    torque = Field("n_joints", unit="N m", text="of each motor")
    speed = Field("n_joints", unit="rad/s", text="of each motor")


class MotorModel(Block):
    """Torques as the joints feel them, from drives that believe in the nominal torque constant.

    A motor that is asked for u gives, with c the factor on its torque constant, s its saturation, l the load
    friction of its gear and w its speed::

        tau = c u (1 - s min(|u| / peak, 1)^2) (1 - l sign(u) tanh(w / load_speed))

    ``command`` asks for what gives the desired feedforward torques, at most for the peak; gains and targets
    pass. ``joints`` has the torques that the measured currents give. All other blocks then work
    with torques at the joints: ``graphs/controllers/motor_model.yaml`` puts this block between controller and
    drives. With the default parameters nothing changes but rounding.

    What the motors can give at most follows from torque constant and saturation; say so to the
    whole-body controller (``wbc.peak_torque``).
    """

    Params = MotorModelParameters
    Constants = MotorModelConstants
    Scratch = MotorModelScratch
    needs = ("robot",)
    params: MotorModelParameters
    constants: MotorModelConstants

    desired = Input(JointCommand, text="what the joints shall get")
    measured = Input(JointState, text="the joints, torques as the drives report them")
    command = Output(JointCommand, text="what the drives must be asked for")
    joints = Output(JointState, text="the joints with the torques that they get")

    def prepare(self) -> None:
        constants, params, robot = self.constants, self.params, self.robot
        constants.to_motor[:] = robot.joint_to_motor
        constants.torque_to_joint[:] = robot.joint_to_motor.T
        constants.torque_to_motor[:] = np.linalg.inv(robot.joint_to_motor.T)
        constants.peak[:] = robot.motors.peak_torque
        constants.torque_constant[:] = params.torque_constant.resolve(robot)
        constants.saturation[:] = params.saturation.resolve(robot)
        constants.load_friction[:] = params.load_friction.resolve(robot)

    @kernel
    @staticmethod
    def step(
        desired: JointCommand,
        measured: JointState,
        command: JointCommand,
        joints: JointState,
        params: MotorModelParameters,
        constants: MotorModelConstants,
        scratch: MotorModelScratch,
    ) -> None:
        command.mode = desired.mode
        command.position[:] = desired.position
        command.velocity[:] = desired.velocity
        command.stiffness[:] = desired.stiffness
        command.damping[:] = desired.damping
        joints.position[:] = measured.position
        joints.velocity[:] = measured.velocity
        torque = scratch.torque
        multiply_vector(constants.to_motor, measured.velocity, scratch.speed)
        multiply_vector(constants.torque_to_motor, desired.torque, torque)
        for k in range(torque.shape[0]):
            torque[k] = request(k, torque[k], scratch.speed[k], params.load_speed, constants)
        multiply_vector(constants.torque_to_joint, torque, command.torque)
        multiply_vector(constants.torque_to_motor, measured.torque, torque)
        for k in range(torque.shape[0]):
            torque[k] = response(k, torque[k], scratch.speed[k], params.load_speed, constants)
        multiply_vector(constants.torque_to_joint, torque, joints.torque)


@kernel
def passed_share(
    k: int, torque: float, speed: float, load_speed: float, constants: MotorModelConstants
) -> float:
    """The share of a motor's torque that its gear passes on."""
    sign = 1.0 if torque > 0.0 else -1.0
    return float(1.0 - constants.load_friction[k] * sign * math.tanh(speed / load_speed))


@kernel
def response(
    k: int, asked: float, speed: float, load_speed: float, constants: MotorModelConstants
) -> float:
    """What motor k gives [N m] of what it is asked for."""
    peak, load = constants.peak[k], 0.0
    if peak > 0.0:
        load = min(abs(asked) / peak, 1.0)
    given = asked * constants.torque_constant[k] * (1.0 - constants.saturation[k] * load * load)
    return float(given * passed_share(k, asked, speed, load_speed, constants))


@kernel
def request(
    k: int, wanted: float, speed: float, load_speed: float, constants: MotorModelConstants
) -> float:
    """What motor k must be asked for [N m] to give what is wanted: Newton's method on x - s x^3 = y."""
    share = passed_share(k, wanted, speed, load_speed, constants)
    asked, peak = wanted / (constants.torque_constant[k] * share), constants.peak[k]
    s = constants.saturation[k]
    if peak <= 0.0 or s == 0.0:
        return float(asked)
    y = min(abs(asked) / peak, 1.0 - s)
    x = y
    for _ in range(_ITERATIONS):
        x = min(x + (y - x + s * x * x * x) / (1.0 - 3.0 * s * x * x), 1.0)
    return math.copysign(x * peak, asked)
