"""The simulated robot without its ports: rigid bodies, contact, sensors, and a standing start.

``MujocoRobot`` puts a graph's ports around it, and the twin the buses of the real robot. The
owner of a plant gives the torques of its drives, and lets it simulate so many physics steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

from ...blocks.signals import ExternalForce, ImuReading, JointState, RobotHealth
from ...mathematics.arrays import (
    Array,
    Flags,
    Indices,
)
from ...mathematics.compiling.call_sequence import Call, CallSequence
from ...mathematics.compiling.foreign_call import ForeignCall
from ...mathematics.compiling.kernel_call import KernelCall
from ...robots.description import RobotDescription
from ...runtime.language.block import Metric
from ...runtime.language.steps import signal_call
from ..drive_control import correction_calls
from ..random_streams import Purpose, RandomStreams, stream
from ..sensors.sensor import mounted_sensors
from .base import BASES
from .battery import Battery
from .chosen_effects import chosen_effects, effect_dimensions
from .contact_bias import ContactBias
from .drive_effects import drive_lag
from .drives import MotorLimits
from .effect import Effect, StepViews
from .external_forces import ExternalForces
from .gantry import Gantry
from .mujoco_model import body_name, build_world, number_of_soles
from .parameters import SimulatorParameters
from .physics_step import flight_step_calls, step_calls
from .sensors import SimulatedSensors
from .stance import (
    centre_on_origin,
    holding_gains,
    holding_torque,
    passive_joints,
    put_down,
    set_standing_pose,
)
from .start_check import StartCheck
from .state import (
    PhysicsState,
    SensorMemory,
    StepSensors,
    TickRecord,
    clear,
    mean_over_steps,
    read_encoders,
    record_step,
)
from .truth import TruthReport
from .variation import Variation, draw_variation
from .windings import NOMINAL, Windings

if TYPE_CHECKING:
    from mujoco import MjData


Kind = TypeVar("Kind", bound=Effect)

SETTLING_TIME, OBSERVED_TIME = 0.3, 0.02
"""Time for which a robot settles before the check that it stands, and the last part of it, in which the load is
averaged [s]."""


class JointTorques(Protocol):
    """The drives of a plant, as its physics sees them."""

    limits: MotorLimits
    """Limits of the motors, and their commanded torques within them."""

    def torque_call(
        self, step: Indices, position: Array, velocity: Array, speed: Array, out: Array
    ) -> Call:
        """Return the call that writes the joint torques [N m] during the physics step ``step``, a count without a
        dimension, to ``out``, from the reading of the drives' encoders [rad, rad/s] and the true joint velocities
        ``speed`` [rad/s]. All arrays keep their place in memory."""


class Plant:
    """The physics of a robot in its scene, in steps of ``params.timestep``.

    All that changes in a run is in the given signals or, between ``save`` and ``load``, in the
    simulator's memory, so that a snapshot is exact.

    Args:
        robot: the description, with the actuator profile in use.
        params: the scene, what is drawn from the seed, and the sensors' errors.
        period: the control period [s]; the start phase is drawn within it.
        physics: the simulator's state, as ``save`` writes it, and the count of physics steps.
        record: sums and extremes since the last ``clear_record``.
        sensed: memory of the sensors that the description mounts; by default it is allocated.
        samples_per_tick: how many samples they take in a control period.

    Attributes:
        model, data: the simulator's.
        variation: the values that were drawn from the seed.
        streams: the random streams of the run.
        sensors: what makes readings of the true motion.
        stiffness, damping: the gains [N m/rad, N m s/rad] (n_joints,) that hold the standing pose.
        position, velocity: the true joint motion [rad, rad/s], views of the simulator's memory.
        effects: what is not ideal, in the order in which a physics step has it.
        clear_call: begins a new record, except for the memory of the switches.
        forces: what acts on the robot from outside.
        step1, step2: the two parts of a physics step, see ``step_calls``.
        late: delay [s] of the physics steps after the control clock's ticks.
    """

    def __init__(
        self,
        robot: RobotDescription,
        params: SimulatorParameters,
        period: float,
        physics: PhysicsState,
        record: TickRecord,
        sensed: SensorMemory | None = None,
        samples_per_tick: float = 1.0,
    ) -> None:
        import mujoco

        self.physics, self.record = physics, record
        self.variation = draw_variation(params, robot)
        self.model = build_world(params, robot, self.variation)
        self._robot, self._params, self._period = robot, params, period
        self.streams = RandomStreams(params.seed_of_noise, _noisy_fields(robot))
        self.sensors = SimulatedSensors(robot, params, self.streams, sensed)
        self._samples_per_tick = samples_per_tick
        whole = self.model
        if params.actuators.gears is not None:
            whole = build_world(params, robot, replace(self.variation, rotor_share=1.0))
        lag = drive_lag(params.sensors.encoders, params.actuators.motors)
        self.stiffness, self.damping = holding_gains(whole, robot, lag)
        self._passive = passive_joints(robot)
        self._limits = (robot.joint_limits[:, 0].copy(), robot.joint_limits[:, 1].copy())
        self._encoder = np.zeros(len(robot.joints))
        self.clear_call = signal_call(clear, record)
        self.start_delay = 0.0
        self._attach(mujoco.MjData(self.model))

    @staticmethod
    def state_dimensions(params: SimulatorParameters, robot: RobotDescription) -> Mapping[str, int]:
        """Return the sizes of the simulator's state and of the random streams'."""
        import mujoco

        model = build_world(params, robot, Variation())
        everything = mujoco.mjtState.mjSTATE_INTEGRATION
        return {
            "n_integration": mujoco.mj_stateSize(model, everything),
            "n_random": RandomStreams(params.seed_of_noise, _noisy_fields(robot)).words,
            **SimulatedSensors.dimensions(params, mounted_sensors(robot)),
            **effect_dimensions(params, robot),
        }

    def _attach(self, data: MjData) -> None:
        """Make the views into the simulator's memory, once."""
        model = self.model
        self.data = data
        base = self._base = BASES[self._robot.base_joint](data)
        self.position, self.velocity = data.qpos[base.positions :], data.qvel[base.velocities :]
        period = self._period / self._samples_per_tick
        self.sensors.attach(model, data, period, self._samples_per_tick)
        # The sensors of the contact points are the model's last, those of soles come before them.
        first = model.nsensordata - 4 * len(self._robot.contacts)
        soles = data.sensordata[first - number_of_soles(model) : first]
        load = data.sensordata[first:].reshape(-1, 4)
        self.truth = TruthReport(
            data, base, self._robot, self._params.build_scene(self._robot), self.record
        )
        joints = len(self._robot.joints)
        views = StepViews(
            base, self.position, self.velocity, data.ctrl[:joints],  # those of thrusters follow
            self.position, self.velocity, self.velocity, base.angular_velocity,
            data.sensor("accelerometer").data, self.record.closed,
        )  # fmt: skip
        self.effects = chosen_effects(
            self._params, self._robot, self.variation, model, data, base, self.physics
        )
        self._motion_calls: list[Call] = []
        self._model_calls: list[Call] = []
        self._reading_calls: list[Call] = []
        for effect in self.effects:
            self._motion_calls += effect.motion_calls(views)
            self._model_calls += effect.model_calls(views)
            self._reading_calls += effect.reading_calls(views)
            views = effect.seen(views)
        self._views = views
        seen = StepSensors(load, soles, views.force, data.sensor("contacts").data, self.position)
        self._record_call = signal_call(
            record_step, self.physics.step, seen, *self._limits, self.sensors.ground_force,
            self.sensors.bounce_steps, self.record,
        )  # fmt: skip
        self._encoder_call = KernelCall(
            read_encoders, views.angle, self.sensors.encoder_offset, self._encoder
        )
        self.step1, self.step2 = step_calls(model, data)
        self._advance: list[Call] = [self.step2]
        if self._params.flight_integrator == "RK4":
            self._advance = flight_step_calls(model, data, self.step2)
        if self._params.ground.contact_bias:
            self.step1 = ForeignCall(ContactBias(model, data).begin_step, 0)
        self.forces = ExternalForces(model, data, self._robot)
        self.gantry = self._effect(Gantry)
        self.battery, self.windings = self._effect(Battery), self._effect(Windings)

    def _effect(self, kind: type[Kind]) -> Kind | None:
        """Return the effect of a kind; ``None`` if there is none."""
        return next((effect for effect in self.effects if isinstance(effect, kind)), None)

    @property
    def sensed(self) -> tuple[Array, Array]:
        """The encoders' reading of the joint motion [rad, rad/s], without their offsets."""
        return self._views.angle, self._views.speed

    def stand(self, step: CallSequence, hold: Callable[[Array, Array], None]) -> None:
        """Stand on the ground and settle, up to the first instant of the control clock.

        Args:
            step: simulates one physics step, with the drives that give the torques meanwhile.
            hold: called with the joint angles [rad] and the static torques [N m] that the drives
                are to hold.

        Raises:
            StartError: the robot does not stand as its description says.
        """
        import mujoco

        step.prepare()
        params = self._params
        attitude = stream(params.seed_of_noise, Purpose.ATTITUDE).standard_normal(3)
        mujoco.mj_resetData(self.model, self.data)
        model, data, base, robot = self.model, self.data, self._base, self._robot
        tilt, level = (
            attitude * params.start.initial_attitude_error,
            bool(self.variation.link_length),
        )
        normal = self._params.build_scene(robot).normal(0.0, 0.0)
        if params.start.stand:
            set_standing_pose(model, data, base, robot, tilt, level, normal)
        else:
            put_down(model, data, base, robot, tilt)
        placed = data.qpos.copy()
        if self.gantry is not None and params.start.gantry is not None:
            base.shift(np.array([0.0, 0.0, params.start.gantry.height]))
            mujoco.mj_kinematics(model, data)
            self.gantry.tie()
        rotation = data.body(body_name(robot.base)).xmat.reshape(3, 3).copy()
        pose = self.position.copy()
        self._begin_effects()
        hangs = self.gantry is not None
        torque = holding_torque(model, data, base, robot, hangs)
        hold(self.position + self.sensors.encoder_offset, torque)
        phase = 0.0
        if params.start.random_start_phase:
            phase = float(stream(params.seed_of_noise, Purpose.START_PHASE).random()) * self._period
        early = math.floor(phase / params.timestep)
        self.start_delay = phase - early * params.timestep
        self.step1.run()
        observed = math.ceil(OBSERVED_TIME / params.timestep)
        self._settle(step, math.ceil(SETTLING_TIME / params.timestep) + early - observed)
        self.clear_record()
        self._settle(step, observed)
        load = self.record.load[:, 3] / -observed
        check = StartCheck(model, data, base, robot, hangs)
        if not params.start.stand or (check.may_fall and not check.stays(pose)):
            data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = placed, 0.0, 0.0
            mujoco.mj_kinematics(model, data)
        else:
            check.check(load, pose, torque, rotation)
        if not hangs:
            centre_on_origin(data, base, robot)
        self.data.time = 0.0
        steps = round(self._period / params.timestep)
        self.physics.step[()] = -steps
        self.record.bounce_end.fill(-steps)
        self.step1.run()
        self.clear_record()
        for sensor in self.sensors.mounted:
            sensor.reset()
        self._settle(step, steps)
        if self.gantry is not None:
            self.gantry.lower(self.physics.step)

    def _begin_effects(self) -> None:
        """Let all effects begin anew, and read the pose."""
        for effect in self.effects:
            effect.begin(self.position)
        self.step1.run()
        for call in self._reading_calls:
            call.run()

    def _settle(self, step: CallSequence, steps: int) -> None:
        """Simulate physics steps in which joints that no motor can move stay in the standing pose,
        as if held by hand."""
        for _ in range(steps):
            step.run()
            if len(self._passive):
                self.position[self._passive] = self._robot.standing_position[self._passive]
                self.velocity[self._passive] = 0.0
                self.step1.run()

    def simulation(
        self, drives: JointTorques, steps: int, push: ExternalForce | None = None,
        thrusters: Sequence[Call] = (),
    ) -> CallSequence:  # fmt: skip
        """Return the calls that simulate physics steps; afterwards all derived quantities are up to date.

        ``push`` is a force from outside, held for all these steps; see ``forces.check``. With it the cable
        pulls, too: it is put on when the robot stands. ``thrusters`` are what those do in every step.
        """
        step, views, limits = self.physics.step, self._views, drives.limits
        stands = push is not None
        added = [c for each in self.effects for c in each.force_calls(step, stands=stands)]
        one: list[Call] = [
            self._encoder_call,
            *(c for each in self.effects for c in each.limit_calls(limits)),
            drives.torque_call(step, self._encoder, views.speed, views.turning, views.torque),
            *thrusters,
            *(c for each in self.effects for c in each.torque_calls(views, limits)),
            *([self.forces.release_call()] if added else []),
            *([] if push is None else [self.forces.push_call(push)]),
            *added,
            *self._advance, *self._motion_calls, self._record_call, *self.sensors.after_step_calls(),
            *self._model_calls, self.step1, *self._reading_calls,
        ]  # fmt: skip
        return CallSequence([self.forces.release_call(), *(one * steps)])

    def reading_calls(self, imu: ImuReading, joints: JointState) -> list[Call]:
        """Write a sample of the IMU, the gyroscope of this instant and the mean of the accelerometer
        since ``clearing``, and one of the joints with their mean torques."""
        record, sensors = self.record, self.sensors
        force, torque = np.zeros(3), np.zeros(len(self._robot.joints))
        return [
            KernelCall(mean_over_steps, record.accelerometer, record.steps, force),
            KernelCall(mean_over_steps, record.joint_torque, record.steps, torque),
            *correction_calls(self._params, self._robot, self.sensed[1], torque),
            *self.imu_calls(force, imu),
            *sensors.joint_calls(*self.sensed, torque, joints),
        ]

    def imu_calls(self, force: Array, imu: ImuReading) -> list[Call]:
        """Write a sample of the IMU: the gyroscope of this instant, and this specific ``force``
        [m/s^2, body] as the accelerometer's."""
        base = self._base
        return [
            *base.refresh_calls(), *self.sensors.imu_calls(self._views.rate, force, imu)
        ]  # fmt: skip

    def switch_calls(self, closed: Flags) -> list[Call]:
        """Write a sample of the switches, (n_contacts,)."""
        pressed = self._views.closed
        return self.sensors.switch_calls(self.physics.step, self.record, pressed, closed)

    def clear_record(self) -> None:
        """Begin a new record, except for the memory of the switches."""
        self.clear_call.run()

    def save(self) -> None:
        """Copy the state of the simulator and of the random streams to ``physics``."""
        import mujoco

        mujoco.mj_getState(
            self.model, self.data, self.physics.integration, mujoco.mjtState.mjSTATE_INTEGRATION
        )
        self.streams.save(self.physics.random)

    def load(self) -> None:
        """Restore both from ``physics``, and recompute what depends on them."""
        import mujoco

        mujoco.mj_setState(
            self.model, self.data, self.physics.integration, mujoco.mjtState.mjSTATE_INTEGRATION
        )
        self.streams.load(self.physics.random)
        restored = [call for effect in self.effects for call in effect.restore_calls()]
        for call in (*self._model_calls, self.step1, *restored):
            call.run()

    def health_calls(self, health: RobotHealth) -> list[Call]:
        """Write the pack's voltage and the windings' temperatures to all drives, where they are simulated."""
        return [call for effect in self.effects for call in effect.health_calls(health)]

    def voltage(self, supply: float) -> float:
        """Return the voltage of the pack [V], or of the ``supply`` where none is simulated."""
        return supply if self.battery is None else float(self.battery.voltage[0])

    def temperature(self, motor: int) -> float:
        """Return the temperature of a motor's winding [deg C]; the nominal one where none is simulated."""
        if self.windings is None:
            return NOMINAL
        return float(self.physics.winding_temperature[motor])

    def metrics(self) -> Mapping[str, Metric]:
        """Return the values that were drawn from the seed."""
        x, y, z = (1e3 * float(value) for value in self.variation.base_com_offset)
        return {
            "robot_base_com_x_mm": x,
            "robot_base_com_y_mm": y,
            "robot_base_com_z_mm": z,
            "robot_friction": float(self.variation.friction),
            "robot_mass_kg": float(self._robot.total_mass * self.variation.mass),
            "robot_contact_stiffness": float(self.variation.contact_stiffness),
            **(
                {"robot_sole_contacts": int(self.record.sole)}
                if number_of_soles(self.model)
                else {}
            ),
            **{name: value for each in self.effects for name, value in each.metrics().items()},
            **self.variation.metrics(),
        }


def _noisy_fields(robot: RobotDescription) -> dict[str, int]:
    """Return the number of fields with noise of every mounted sensor."""
    return {sensor.name: len(sensor.signal.fields) for sensor in mounted_sensors(robot)}
