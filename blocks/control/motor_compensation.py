"""Asks of motors whose torque constants have drifted what makes them give the torque that is wanted."""

from __future__ import annotations

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.signals import Field, Signal
from ..signals import JointCommand, MotorCondition


class CompensationConstants(Signal):
    """Constants derived from the robot's description."""

    torque_to_motor = Field(("n_joints", "n_joints"), text="joint torques to those of motors")
    torque_to_joint = Field(("n_joints", "n_joints"), text="torques of motors to those of joints")


class CompensationScratch(Signal):
    """Scratch memory of one step of ``MotorCompensation``."""

    torque = Field("n_joints", unit="N m", text="of the motors")


class MotorCompensation(Block):
    """The command whose feedforward torques are by the nominal torque constants, as drives take them.

    A motor with the share c of its nominal torque constant gives c times the torque that is commanded of its drive, so
    for the torque t the command is t / c. ``MotorDrift`` finds c. Through the transmission A: with
    kappa = A^-T tau of the motors, tau' = A^T (kappa / c). Targets and gains pass as they are: a feedback that
    is some per cent weaker needs no correction.
    """

    Constants = CompensationConstants
    Scratch = CompensationScratch
    needs = ("robot",)
    constants: CompensationConstants

    desired = Input(JointCommand, text="the command, with the torques that joints are to get")
    motors = Input(MotorCondition, text="present condition of the motors")
    command = Output(JointCommand, text="the same, with the torques to ask for")

    def setup(self) -> None:
        self.constants.torque_to_motor[:] = self.robot.torque_to_motor
        self.constants.torque_to_joint[:] = self.robot.joint_to_motor.T

    @kernel
    @staticmethod
    def step(
        desired: JointCommand,
        motors: MotorCondition,
        command: JointCommand,
        constants: CompensationConstants,
        scratch: CompensationScratch,
    ) -> None:
        torque = scratch.torque
        torque[:] = constants.torque_to_motor @ desired.torque
        torque[:] = torque / motors.torque_constant
        command.torque[:] = constants.torque_to_joint @ torque
        command.mode = desired.mode
        command.position[:] = desired.position
        command.velocity[:] = desired.velocity
        command.stiffness[:] = desired.stiffness
        command.damping[:] = desired.damping
