"""Follows what drifts in motors and their pack: torque constants, speeds, open voltage and resistance."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....blocks.signals import JointState, MotorCondition, RobotHealth
from ....mathematics.arrays import Array1D
from ....mathematics.constants import COPPER, MAGNETS
from ....mathematics.kernel import kernel
from ....runtime.language.block import Block, Input, Metric, Output, State
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal


class DriftParameters(Parameters):
    """The parameters of ``MotorDrift``."""

    nominal_temperature: float = parameter(
        25.0, ge=-40.0, le=100.0,
        text="of the windings when torque constants and speeds were found [deg C]",
    )  # fmt: skip
    magnets: float = parameter(
        MAGNETS, unit="1/K", ge=0.0, le=0.01, text="share of a torque constant that is lost"
    )
    copper: float = parameter(
        COPPER, unit="1/K", ge=0.0, le=0.01, text="share of a winding's resistance that is gained"
    )
    pack_resistance: float = parameter(
        0.04, unit="ohm", ge=0.0, text="of the pack and its leads, at first"
    )
    resistance_std: float = parameter(
        0.02, unit="ohm", gt=0.0, text="standard deviation of that, before anything is measured"
    )
    voltage_drift: float = parameter(
        0.05, unit="V/s", ge=0.0, text="change of the open voltage in a second"
    )
    resistance_drift: float = parameter(
        0.0005, unit="ohm/s", ge=0.0, text="change of the resistance in a second"
    )
    voltage_noise: float = parameter(
        0.1,
        unit="V",
        gt=0.0,
        text="standard deviation of a voltage that the model does not explain",
    )


class DriftConstants(Signal):
    """Constants derived from the robot's description."""

    joint_to_motor = Field(("n_joints", "n_joints"), text="joint velocities to those of motors")
    torque_to_motor = Field(("n_joints", "n_joints"), text="joint torques to those of motors")
    torque_to_joint = Field(("n_joints", "n_joints"), text="torques of motors to those of joints")
    heating = Field("n_joints", text="copper heat for the nominal torque squared [W/(N m)^2]")
    bend = Field("n_joints", text="1 - corner speed / no-load speed")
    rated_voltage = Field(unit="V", text="at which the speeds hold; zero: not known")


class DriftScratch(Signal):
    """Scratch memory of one step of ``MotorDrift``."""

    torque = Field("n_joints", unit="N m", text="of the motors, by their nominal constants")
    speed = Field("n_joints", unit="rad/s", text="of the motors")


class PackState(Signal):
    """Estimate of the pack: mean and covariance of its two numbers."""

    open_voltage = Field(unit="V", text="without load")
    resistance = Field(unit="ohm", text="of pack and leads")
    p_uu = Field(unit="V^2", text="variance of the open voltage")
    p_ur = Field(unit="V ohm", text="covariance of both")
    p_rr = Field(unit="ohm^2", text="variance of the resistance")
    known = Field(dtype="bool", text="a voltage was measured")


class MotorDrift(Block):
    """The present condition of motors and pack, by the temperatures, voltages and torques that the drives report.

    **Windings.** With the temperature T of a winding, magnets lose remanence and copper gains resistance,
    so of a motor's torque constant and of its winding's resistance there are left::

        c = 1 - magnets (T - nominal),    r = 1 + copper (T - nominal)

    (neodymium-iron-boron: 0.11 to 0.12 %/K, copper: 0.39 %/K at 25 deg C; makers' data sheets). Drives report
    torques by the nominal constants, and ``joints`` has those that the motors give. At the reported voltage U
    the current is at most (U - k v) / R, so the motor's speeds without load and at the corner of its curve become::

        w_0' = w_0 (U / U_rated) / c,    w_c' = w_0 (U / U_rated) (1 - r (1 - w_c / w_0)) / c

    **Pack.** The current I = P / U follows from the motors' work and copper heat P. Open voltage and
    resistance are two random walks, of which each tick measures U = U_0 - R I (Kalman filter of two states); what
    the boards draw is part of the open voltage.

    ``motors`` goes to ``WholeBodyController`` and ``MotorCompensation`` (``controllers/warm_motors.yaml``). A drive that
    reports no temperature (zero) counts as nominal, and without a voltage, or with a description without
    ``supply``, speeds are those of the description. Magnets are taken to be as warm as the windings, which overstates
    the loss while these warm faster than the magnets do.
    """

    Params = DriftParameters
    Constants = DriftConstants
    Scratch = DriftScratch
    needs = ("robot",)
    params: DriftParameters
    constants: DriftConstants

    health = Input(RobotHealth, text="temperatures and voltages of the drives")
    measured_joints = Input(JointState, text="readings of the joints, torques by nominal constants")
    joints = Output(JointState, text="the same with the torques that the motors give")
    motors = Output(MotorCondition, text="condition of the motors and the pack")
    pack = State(PackState, text="estimate of the pack")

    def setup(self) -> None:
        robot, constants, rated = self.robot, self.constants, self.robot.motors
        constants.joint_to_motor[:] = robot.joint_to_motor
        constants.torque_to_motor[:] = robot.torque_to_motor
        constants.torque_to_joint[:] = robot.joint_to_motor.T
        constants.bend[:] = 1.0 - rated.corner_speed / rated.no_load_speed
        if robot.supply is not None:
            constants.heating[:] = robot.supply.heating(rated)
            constants.rated_voltage = robot.supply.rated_voltage

    @kernel
    @staticmethod
    def step(
        health: RobotHealth,
        measured_joints: JointState,
        joints: JointState,
        motors: MotorCondition,
        pack: PackState,
        params: DriftParameters,
        constants: DriftConstants,
        scratch: DriftScratch,
        period: float,
    ) -> None:
        torque, speed = scratch.torque, scratch.speed
        torque[:] = constants.torque_to_motor @ measured_joints.torque
        speed[:] = constants.joint_to_motor @ measured_joints.velocity
        voltage = mean_voltage(health.voltage)
        ratio = 1.0
        if constants.rated_voltage > 0.0 and voltage > 0.0:
            ratio = voltage / constants.rated_voltage
        power = 0.0
        for k in range(torque.shape[0]):
            above = 0.0
            if health.temperature[k] != 0.0:
                above = health.temperature[k] - params.nominal_temperature
            constant = max(1.0 - params.magnets * above, 0.1)
            resistance = max(1.0 + params.copper * above, 0.1)
            motors.torque_constant[k] = constant
            motors.no_load_speed[k] = ratio / constant
            slower = max(1.0 - resistance * constants.bend[k], 0.0)
            motors.corner_speed[k] = ratio / constant * slower / (1.0 - constants.bend[k])
            power += constants.heating[k] * resistance * torque[k] * torque[k]
            torque[k] = constant * torque[k]
            power += torque[k] * speed[k]
        joints.position[:] = measured_joints.position
        joints.velocity[:] = measured_joints.velocity
        joints.torque[:] = constants.torque_to_joint @ torque
        if voltage > 0.0:
            follow_pack(voltage, power / voltage, pack, params, period)
        motors.open_voltage = pack.open_voltage
        motors.pack_resistance = pack.resistance

    def metrics(self) -> Mapping[str, Metric]:
        """Return the weakest motor, and the pack where a voltage was reported."""
        found: dict[str, Metric] = {
            "least_torque_constant": float(np.min(self.motors.torque_constant))
        }
        if self.pack.known:
            found["open_voltage_v"] = float(self.pack.open_voltage)
            found["pack_resistance_ohm"] = float(self.pack.resistance)
        return found


@kernel
def mean_voltage(voltages: Array1D) -> float:
    """Return the mean of the voltages that are reported [V]; zero if none is."""
    total, count = 0.0, 0
    for k in range(voltages.shape[0]):
        if voltages[k] > 0.0:
            total += voltages[k]
            count += 1
    return total / max(count, 1)


@kernel
def follow_pack(
    voltage: float, current: float, pack: PackState, params: DriftParameters, period: float
) -> None:
    """Make a step of the Kalman filter: ``voltage`` [V] = open voltage - resistance times ``current`` [A]."""
    if not pack.known:
        pack.resistance = params.pack_resistance
        pack.open_voltage = voltage + pack.resistance * current
        pack.p_uu = 1.0
        pack.p_rr = params.resistance_std * params.resistance_std
        pack.known = True
        return
    # A walk whose standard deviation after a second is the drift has this variance in a tick.
    pack.p_uu += params.voltage_drift * params.voltage_drift * period
    pack.p_rr += params.resistance_drift * params.resistance_drift * period
    towards_u = pack.p_uu - pack.p_ur * current
    towards_r = pack.p_ur - pack.p_rr * current
    noise = params.voltage_noise * params.voltage_noise
    total = towards_u - towards_r * current + noise
    beyond = voltage - (pack.open_voltage - pack.resistance * current)
    pack.open_voltage += towards_u / total * beyond
    pack.resistance = max(pack.resistance + towards_r / total * beyond, 0.0)
    pack.p_uu -= towards_u * towards_u / total
    pack.p_ur -= towards_u * towards_r / total
    pack.p_rr -= towards_r * towards_r / total
