"""The robot simulated by MuJoCo, behind the same ports as a real one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ...blocks.signals import ThrustCommand, ThrusterState
from ...mathematics.compiling.call_sequence import Call, CallSequence
from ...robots.description import RobotDescription
from ...runtime.language.block import Context, Metric, Port, State, UnmetRequirement
from ...runtime.language.parameters import Parameters
from ...runtime.language.signals import StateElements
from ..drive_control import gain_requirements, lost_gains
from .motor_feedback import FeedbackState, MotorFeedback
from .parameters import SimulatorParameters
from .simulated_robot import SimulatedRobot, impossible_effects
from .state import DriveState, TickRecord, integration_elements
from .thrusters import SimulatedThrusters, ThrustQueue
from .unsupported import uneven_contacts, unsupported_motor


class MujocoRobot(SimulatedRobot):
    """The robot of the graph in MuJoCo: rigid links, rotors, motors, contact, noisy sensors.

    Time: the control tick ``n`` is at ``t_n``. Physics runs in steps of ``timestep`` between ticks;
    with ``random_start_phase`` it starts at a phase of the control clock drawn from the seed.
    Sensors are sampled at ``t_n``: the gyroscope and the joints at that instant, the accelerometer
    and the torques as their means over the tick before (their filters pass no more), the switches
    by the force in the physics step before. The command computed from them takes effect at the
    first physics step at or after ``t_n + latency + jitter``, and stays in effect until the next
    one does. Meanwhile the drives close their loops at the physics rate by their own encoders, and
    limit the torques in motor space by the torque-speed curves.

    With an ``actuators.bus_period`` they are the drives of a real robot: each closes a loop on its own motor, with
    gains that are fixed for the run (``stiffness`` and ``damping`` of the joints, through the
    transmission), around goals that a driver renews when a command arrives and once a period, from the
    measurement of the exchange before. The command's gains are met at the instant of each measurement
    (``hal/drive_control.py``). Without it the driver is taken as infinitely fast: every joint gets its
    command's own gains in every physics step, as no real drives could give them.

    Command modes: ``OFF`` gives no torque, ``ACTIVE`` feedforward plus joint feedback, ``DAMPING``
    the damping ``drive_damping`` on every joint, whatever the command's gains are.

    Thrusters of the description get an input ``thrust``, which arrives with the joint command of its tick, and
    the output ``thrusters``. Thrust is limited to that of the description and follows with its lag; in all modes but
    ``ACTIVE`` none is commanded, so a robot in flight falls when a run ends.

    Start: the robot stands in its description's pose (torso turned by a drawn
    ``initial_attitude_error``, soles flat), held by its drives around the static torques with gains
    that follow from its weight and inertia (``stance.py``), settles for 0.3 s, and is centred: the
    middle between the soles is the world's origin. It is held so until the first command arrives.
    Joints without a working motor are kept in the standing pose until the run begins. A fixed base
    is at the world's origin from the start, and a robot without feet lies on its lowest shape. One that does not stay
    there begins from rest as it was put down, and so does any robot with ``start.stand: false``.

    For a joint that slides, metres and newtons stand for radians and newton metres in every parameter
    and signal.

    All random numbers follow from ``seed``, or with ``noise_seed`` those that differ between two runs of
    one robot from that. Every disturbance has a stream of its own, so setting one to zero changes no
    other. Snapshots are exact: a restored run continues bit for bit.

    A real robot differs from its description in what the groups ``start``, ``ground``, ``body``, ``sensors`` and
    ``actuators`` say; by default in nothing. The trial ``graphs/trials/real.yaml`` has the usual sizes.

    It does not model: contact of a limb with the torso or with itself, wind.

    Raises:
        StartError: the robot does not stand as its description says.
        IndexError: a push acts at a point that the robot does not have.
    """

    Params = SimulatorParameters
    needs = ("robot",)
    params: SimulatorParameters

    drives = State(DriveState, text="commands in the drives and on their way")
    feedback = State(FeedbackState, text="the goals of the drives' own loops")
    record = State(TickRecord, text="sums over the physics steps of the last tick")
    thrust: ThrustCommand
    thrusters: ThrusterState
    thrust_queue: ThrustQueue

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """All disturbances at once that any robot bears, so that the conformance suite covers them."""
        return {
            "timestep": 0.00025, "latency": 0.002, "jitter": 0.0005,
            "start": {"initial_attitude_error": 0.01, "random_start_phase": True},
            "ground": {"floor_tilt": 0.01, "soles": {"time_constant": 0.006, "damping_ratio": 0.8}},
            "body": {
                "links": {
                    "mass_spread": 0.05, "com_spread": 0.003, "inertia_spread": 0.1, "length_spread": 0.003,
                },
                "cable": {"pull": 0.004, "weight": 0.002},
            },
            "sensors": {
                "gyro_noise": 0.02, "gyro_bias": 0.01, "gyro_range": 30.0,
                "accelerometer_noise": 0.1, "accelerometer_bias": 0.1, "accelerometer_range": 160.0,
                "encoder_offset": 0.003, "encoder_resolution": 1e-4, "joint_velocity_noise": 0.05,
                "switch_threshold": [0.5, 3.0], "switch_bounce": 0.002,
                "imu": {
                    "gyro_delay": 0.001, "accelerometer_delay": 0.002, "delay_spread": 0.0005,
                    "bandwidth": 100.0, "mount_frequency": 300.0, "position": [0.01, 0.0, 0.02],
                    "position_spread": 0.005, "rotation_spread": 0.01, "gyro_scale_spread": 0.01,
                    "accelerometer_scale_spread": 0.01, "acceleration_sensitivity": 1e-4,
                },
                "encoders": {
                    "delay": 0.00025, "velocity_filter": 0.0005, "eccentricity": 0.002,
                    "compliance": 1e-5, "backlash": 0.2,
                },
                "switches": {"threshold": [0.04, 0.25], "debounce": 0.001, "sticking": 0.002},
            },
            "actuators": {
                "bus_period": 0.001,
                "joints": {
                    "friction_spread": 0.2, "rotor_inertia": 1.1, "rotor_inertia_spread": 0.1,
                    "static_friction": 1.2, "static_friction_spread": 0.3,
                },
                "motors": {
                    "torque_constant_spread": 0.05, "saturation": 0.1, "current_bandwidth": 300.0,
                    "torque_limit": 1000.0, "ripple": 0.005, "load_friction": 0.05, "cogging": 0.01,
                },
                "battery": {"resistance": 0.03},
                "windings": {"temperature": 60.0, "heat_capacity": 15.0, "thermal_resistance": 5.0},
            },
        }  # fmt: skip

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a transmission that the simulator cannot express, gains that no drives can give, and
        feet that cannot stand."""
        robot = context.robot
        assert isinstance(params, SimulatorParameters) and robot is not None
        complaint = unsupported_motor(robot)
        if complaint:
            yield UnmetRequirement(
                complaint, fix="correct `transmission` in the robot's description"
            )
        elif params.actuators.bus_period is not None:
            yield from gain_requirements(params, robot)
        stands = robot.base_joint != "fixed" and params.start.stand
        uneven = uneven_contacts(robot) if stands else ""
        if uneven:
            yield UnmetRequirement(
                uneven,
                fix="correct `standing` or the positions under `contacts` in its description",
            )
        yield from impossible_effects(params, robot)
        bus = params.actuators.bus_period
        whole = context.period if bus is None else bus
        what = "the control period" if bus is None else "bus_period"
        steps = whole / params.timestep
        if not _is_whole(steps):
            yield UnmetRequirement(
                f"timestep {params.timestep} s does not divide {what} {whole} s",
                parameter="timestep",
                expected=f"a whole fraction of {whole} s",
                found=f"{params.timestep} s",
                fix=f"timestep: {_nearest_step(whole, params.timestep):.10g} s",
            )
        if bus is not None and not _is_whole(context.period / bus):
            yield UnmetRequirement(
                f"bus_period {bus} s does not divide the control period {context.period} s",
                parameter="actuators.bus_period",
                expected=f"a whole fraction of {context.period} s",
                found=f"{bus} s",
                fix=f"actuators: {{bus_period: {_nearest_step(context.period, bus):.10g} s}}",
            )

    @classmethod
    def ports_of_thrusters(cls, robot: RobotDescription) -> dict[str, Port[Any]]:
        """Return the ports of thrusters, and what is on its way to them."""
        ports = cls.thrust_ports(robot)
        queue = State(ThrustQueue, text="thrust that goes with the commands in the drives")
        return {**ports, "thrust_queue": queue} if ports else {}

    @classmethod
    def nominal_delay(cls, params: Parameters) -> float:
        """Return the latency that is simulated."""
        assert isinstance(params, SimulatorParameters)
        return params.latency

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Return a push at a point that the robot has, and none where it has no points."""
        count = dimensions["n_points"]
        force = rng.uniform(-1.0, 1.0, 3) if count else np.zeros(3)
        return {"push": {"force": force, "point": rng.integers(max(1, count))}}

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Sizes of the simulator's state, of the random streams' and of the command ring."""
        from .plant import Plant  # which a check of the graph does not need

        assert isinstance(params, SimulatorParameters) and robot is not None
        flight = params.latency + params.jitter + params.timestep
        return {
            **Plant.state_dimensions(params, robot),
            "n_queue": math.ceil(flight / params.timestep) + 2,
        }

    def setup(self) -> None:
        """Draw the world from the seed and build it."""
        from ...runtime.language.random_stream import uniform_call
        from ..random_streams import Purpose
        from .drives import CommandLatency, SimulatedDrives
        from .plant import Plant
        from .stance import RELEASED

        robot, params = self.robot, self.params
        plant = self.plant = Plant(
            robot, params, self.period, self.physics, self.record,
            getattr(self, "sensor_memory", None),
        )  # fmt: skip
        steps = round(self.period / params.timestep)
        damping = RELEASED * plant.damping
        if params.actuators.drive_damping is not None:
            damping = np.full(len(robot.joints), params.actuators.drive_damping)
        feedback, bus = None, params.actuators.bus_period
        if bus is not None:
            exchange = round(bus / params.timestep)
            feedback = MotorFeedback(robot, params, bus, exchange, self.feedback)
        drives = self._drives = SimulatedDrives(robot, damping, self.drives, self.record, feedback)
        thrusters, following = None, list[Call]()
        if robot.thrusters:
            thrusters = SimulatedThrusters(
                robot, plant.model, plant.data, self.drives, self.thrust_queue
            )
            following.append(thrusters.follow_call())
        self._reading = CallSequence([
            *plant.reading_calls(self.imu, self.joints),
            *plant.switch_calls(self.contacts.closed),
            *plant.sensors.mounted_calls(self.mounted()),
            *plant.truth.report_calls(self.truth), self.report_call(),
            *plant.health_calls(self.health),
            *([thrusters.read_call(self.thrusters)] if thrusters else []),
        ])  # fmt: skip
        latency = self._latency = CommandLatency(
            np.zeros(1), float(params.jitter), np.zeros(1), params.timestep
        )
        jitter, _ = uniform_call(plant.streams[Purpose.JITTER], latency.draw)
        self._sending = CallSequence([
            *([jitter] if params.jitter else []),
            drives.send_call(self.command, self.physics.step, latency),
            *([thrusters.send_call(self.thrust)] if thrusters else []),
        ])  # fmt: skip
        self._settling = plant.simulation(drives, 1, thrusters=following)
        self._ticking = plant.simulation(drives, steps, self.push, following)
        self._damped = plant.simulation(drives, steps, thrusters=following)

    @property
    def calls(self) -> Mapping[str, Sequence[Call]]:
        """The calls of a tick: ``read`` the sensors, ``send`` the command, ``clear`` the record, and ``advance`` to the
        next tick."""
        return {
            "read": self._reading.calls, "send": self._sending.calls,
            "clear": (self.plant.clear_call,), "advance": self._ticking.calls,
        }  # fmt: skip

    def open(self) -> None:
        """Stand on the ground, settle, and wait for the first command."""
        plant, drives = self.plant, self._drives
        for sequence in (self._reading, self._sending, self._ticking, self._damped):
            sequence.prepare()
        plant.stand(
            self._settling,
            lambda pose, torque: drives.hold(pose, torque, plant.stiffness, plant.damping),
        )
        self._latency.minimum[0] = self.params.latency + plant.start_delay

    def read(self) -> None:
        """Publish the sensors, the truth at the present instant, and that all is well."""
        self._reading.run()

    def report(self) -> None:
        """Nothing: ``read`` has said that all is well."""

    def write(self) -> None:
        """Send the command on its way to the drives."""
        self._sending.run()

    def advance(self) -> None:
        """Simulate to the next tick."""
        self.plant.clear_record()
        self._ticking.run()
        self.plant.forces.check(self.push)

    def damp(self) -> None:
        """Simulate one tick with the drives in damping and no external force."""
        self._drives.damp()
        self.plant.clear_record()
        self._damped.run()

    def save_state(self) -> None:
        """Copy the state of the simulator and the random streams to the declared state."""
        self.plant.save()

    def load_state(self) -> None:
        """Restore both from the declared state, and recompute what depends on them."""
        self.plant.load()

    def state_elements(self) -> Mapping[str, Sequence[StateElements]]:
        """Export the parts of the simulator's state: positions and velocities by joint, and the rest."""
        return {"physics.integration": integration_elements(self.plant.model)}

    def warnings(self) -> Sequence[str]:
        """Say where a play of the gears that is asked for multiplies zero."""
        backlash = self.params.sensors.encoders.backlash
        if backlash == 0.0 or np.any(self.robot.motors.gear_play):
            return ()
        return (
            (
                f"sensors.encoders.backlash: {backlash:g} does nothing: it is a multiple of gear_play [rad], which "
                f"{self.robot.name} does not have; write gear_play under profiles in the robot's YAML"
            ),
        )

    def metrics(self) -> Mapping[str, Metric]:
        """Return the values that were drawn from the seed, and what the drives do not give of the gains."""
        found = self.plant.metrics()
        if self.params.actuators.bus_period is None:
            return found
        return {**found, **lost_gains(self.params, self.robot)}


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= 1e-6 and round(ratio) >= 1


def _nearest_step(period: float, timestep: float) -> float:
    """Return the largest step [s] up to ``timestep`` that divides the period; one of few digits if such a step is
    near."""
    count = max(1, math.ceil(period / timestep))
    steps = [period / k for k in range(count, 2 * count + 1)]
    return next((step for step in steps if abs(step * 1e5 - round(step * 1e5)) < 1e-9), steps[0])
