"""The robot simulated by MuJoCo, behind the same ports as a real one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...blocks.signals import ExternalForce, RobotTruth
from ...robots.description import RobotDescription
from ...runtime.language.block import Context, Input, Metric, Misfit, Output, State
from ...runtime.language.parameters import Parameters
from ...runtime.language.terrain import Ground, Terrain
from ..robot import Robot
from .base import BASES
from .drives import Drives
from .holding import RELEASED, holding_gains, passive_joints
from .mujoco_model import Variation, body_name
from .parameters import SimulatorParameters
from .random_streams import WORDS, Purpose, RandomStreams, stream
from .rotors import unfit_motor
from .sensors import Sensors
from .stance import centre_on_origin, holding_torque, place_standing, uneven_contacts
from .start_check import StartCheck
from .state import DriveState, PhysicsState, TickRecord
from .truth import TruthReport
from .world import build_world, draw_variation

SETTLING_TIME = 0.3
"""The time that a robot settles for, before it is checked whether it stands [s]."""
OBSERVED_TIME = 0.02
"""The last part of the settling time, in which the load on the feet is averaged [s]."""


class MujocoRobot(Robot):
    """The robot of the graph in MuJoCo: rigid links, rotors, motors, contact, noisy sensors.

    Time: the control tick ``n`` is at ``t_n``. Physics runs in steps of ``timestep`` between ticks;
    with ``random_start_phase`` it starts at a phase of the control clock drawn from the seed.
    Sensors are sampled at ``t_n``: the gyroscope and the joints at that instant, the accelerometer
    as its mean over the tick before (its filter passes no more), the switches by the force in the
    physics step before. The command computed from them takes effect at the first physics step at
    or after ``t_n + latency + jitter``, and stays in effect until the next one does. Meanwhile the
    drives close the joint loop at the physics rate with the command's gains, by their own encoders,
    and limit the torques in motor space by the torque-speed curves.

    Command modes: ``OFF`` gives no torque, ``ACTIVE`` feedforward plus joint feedback, ``DAMPING``
    the damping ``drive_damping`` on every joint, whatever the command's gains are.

    Start: the robot stands in its description's pose (torso turned by a drawn
    ``initial_attitude_error``, soles flat), held by its drives around the static torques with gains
    that follow from its weight and inertia (``holding.py``), settles for 0.3 s, and is centred: the
    middle between the soles is the world's origin. It is held so until the first command arrives.
    Joints without a working motor are kept in the standing pose until the run begins. A fixed base
    is at the world's origin from the start, and a robot without feet lies on its lowest shape.

    For a slide, metres and newtons stand for radians and newton metres in every parameter.

    All random numbers follow from ``seed``. Every disturbance has a stream of its own, so setting
    one to zero changes no other. Snapshots are exact: a restored run continues bit for bit.

    It does not model: motor temperature and supply voltage, belt and cable elasticity, backlash,
    contact of a limb with the torso or with itself, an IMU lever arm, wind.

    Raises:
        StartError: the robot does not stand as its description says.
        IndexError: a push acts at a point that the robot does not have.
    """

    outside = "simulated"

    Params = SimulatorParameters
    needs = ("robot",)
    params: SimulatorParameters

    push = Input(ExternalForce, default={}, text="a force from outside, held for the tick")
    truth = Output(RobotTruth, truth=True, text="what only a simulator knows")
    physics = State(PhysicsState, text="the simulator's state, written for a snapshot")
    drives = State(DriveState, text="commands in the drives and on their way")
    record = State(TickRecord, text="what happened in the physics steps of the last tick")

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """All disturbances at once, so that the conformance suite covers them."""
        return {
            "gyro_noise": 0.02, "gyro_bias": 0.01, "gyro_range": 30.0,
            "accelerometer_noise": 0.1, "accelerometer_bias": 0.1, "accelerometer_range": 160.0,
            "encoder_offset": 0.003, "encoder_resolution": 1e-4, "joint_velocity_noise": 0.05,
            "switch_threshold": [0.5, 3.0], "switch_bounce": 0.002, "latency": 0.002,
            "jitter": 0.0005, "initial_attitude_error": 0.01, "random_start_phase": True,
        }  # fmt: skip

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Report a transmission that the simulator cannot express, and feet that cannot stand."""
        assert robot is not None
        complaint = unfit_motor(robot)
        if complaint:
            yield Misfit(complaint, fix="correct `transmission` in the robot's description")
        uneven = uneven_contacts(robot) if robot.base_joint != "fixed" else ""
        if uneven:
            yield Misfit(
                uneven,
                fix="correct `standing` or the positions under `contacts` in its description",
            )

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """Report a physics step that does not divide the block's period."""
        assert isinstance(params, SimulatorParameters)
        steps = context.period / params.timestep
        if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
            yield Misfit(
                f"timestep {params.timestep} s does not divide the control period "
                f"{context.period} s",
                parameter="timestep",
                expected=f"a whole fraction of {context.period} s",
                found=f"{params.timestep} s",
                fix=f"timestep: {_nearest_step(context.period, params.timestep):.10g} s",
            )

    @classmethod
    def terrain(cls, params: Parameters) -> Terrain | None:
        """The scene's floor and boxes."""
        assert isinstance(params, SimulatorParameters)
        scene = params.build_scene()
        boxes = (
            Ground((box.x[0], box.y[0], box.bottom), (box.x[1], box.y[1], box.top))
            for box in scene.boxes
        )
        return Terrain(scene.floor, tuple(boxes))

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """The number of named points that a force may act at; the seed is not a dimension."""
        return {"n_points": len(robot.points) if robot is not None else 0}

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """A push at a point that the robot has, and none where it has no points."""
        count = dimensions["n_points"]
        force = rng.uniform(-1.0, 1.0, 3) if count else np.zeros(3)
        return {"push": {"force": force, "point": rng.integers(max(1, count))}}

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Sizes of the simulator's state, of the random streams' and of the command ring."""
        import mujoco

        assert isinstance(params, SimulatorParameters) and robot is not None
        model = build_world(params, robot, Variation())
        everything = mujoco.mjtState.mjSTATE_INTEGRATION
        flight = params.latency + params.jitter + params.timestep
        return {
            "n_integration": mujoco.mj_stateSize(model, everything),
            "n_random": WORDS,
            "n_queue": math.ceil(flight / params.timestep) + 2,
        }

    def setup(self) -> None:
        """Draw the world from the seed and build it."""
        import mujoco

        robot, params = self.robot, self.params
        self._variation = draw_variation(params)
        self._model = build_world(params, robot, self._variation)
        self._robot = robot
        self._step1, self._step2 = mujoco.mj_step1, mujoco.mj_step2
        self._steps = round(self.period / params.timestep)
        self._streams = RandomStreams(params.seed)
        self._jitter = self._streams[Purpose.JITTER]
        self._sensors = Sensors(robot, params, self._streams)
        self._stiffness, self._damping = holding_gains(self._model, robot)
        damping = RELEASED * self._damping
        if params.drive_damping is not None:
            damping = np.full(len(robot.joints), params.drive_damping)
        self._drives = Drives(robot, damping, self.drives, self.record)
        self._passive = passive_joints(robot)
        self._limits = (robot.joint_limits[:, 0].copy(), robot.joint_limits[:, 1].copy())
        n = len(robot.joints)
        self._encoder, self._excess = np.zeros(n), np.zeros(n)
        self._mean_force = np.zeros(3)
        self._attach(mujoco.MjData(self._model))

    def _attach(self, data: Any) -> None:
        """Make the views into the simulator's memory, once."""
        model = self._model
        self._data = data
        base = self._base = BASES[self._robot.base_joint](data)
        self._position, self._velocity = data.qpos[base.positions :], data.qvel[base.velocities :]
        self._ctrl, self._external = data.ctrl, data.xfrc_applied
        self._accelerometer = data.sensor("accelerometer").data
        self._contacts = data.sensor("contacts").data
        # The sensors of the contact points are the model's last.
        first = model.nsensordata - 4 * len(self._robot.contacts)
        self._load = data.sensordata[first:].reshape(-1, 4)
        self._vertical = self._load[:, 3]
        self._truth = TruthReport(data, base, self._robot, self.params.build_scene())
        self._points = []
        for point, (link, _) in self._robot.points.items():
            body = model.body(body_name(link)).id
            place, centre = data.site(f"point/{point}").xpos, data.xipos[body]
            self._points.append((place, centre, self._external[body]))

    def open(self) -> None:
        """Stand on the ground, settle, and wait for the first command."""
        import mujoco

        params = self.params
        attitude = stream(params.seed, Purpose.ATTITUDE).standard_normal(3)
        mujoco.mj_resetData(self._model, self._data)
        model, data, base, robot = self._model, self._data, self._base, self._robot
        place_standing(model, data, base, robot, attitude * params.initial_attitude_error)
        rotation = data.body(body_name(robot.base)).xmat.reshape(3, 3).copy()
        pose = self._position.copy()
        torque = holding_torque(model, data, base, robot)
        held = self._position + self._sensors.encoder_offset
        self._drives.hold(held, torque, self._stiffness, self._damping)
        phase = 0.0
        if params.random_start_phase:
            phase = float(stream(params.seed, Purpose.START_PHASE).random()) * self.period
        early = math.floor(phase / params.timestep)
        self._late = phase - early * params.timestep
        self._step1(self._model, self._data)
        observed = math.ceil(OBSERVED_TIME / params.timestep)
        self._settle(math.ceil(SETTLING_TIME / params.timestep) + early - observed)
        self._clear_record()
        self._settle(observed)
        load = self.record.load[:, 3] / -observed
        StartCheck(model, data, base, robot).check(load, pose, torque, rotation)
        centre_on_origin(data, base, robot)
        self._data.time = 0.0
        self.physics.step[()] = -self._steps
        self.record.bounce_end.fill(-self._steps)
        self._step1(self._model, self._data)
        self._clear_record()
        self._settle(self._steps)

    def _settle(self, steps: int) -> None:
        """Simulate physics steps in which joints that no motor can move stay in the standing pose,
        as if held by hand."""
        if not len(self._passive):
            self._simulate(steps)
            return
        for _ in range(steps):
            self._simulate(1)
            self._position[self._passive] = self._robot.standing_position[self._passive]
            self._velocity[self._passive] = 0.0
            self._step1(self._model, self._data)

    def read(self) -> None:
        """Publish the sensors and the truth at the present instant."""
        record, steps = self.record, int(self.record.steps)
        np.divide(record.accelerometer, steps, out=self._mean_force)
        self._base.refresh()
        self._sensors.read_imu(self._base.angular_velocity, self._mean_force, self.imu)
        self._sensors.read_joints(self._position, self._velocity, record.joint_torque, self.joints)
        self._sensors.read_switches(int(self.physics.step), record, self.contacts)
        self._truth.publish(record, self.truth)

    def write(self) -> None:
        """Send the command on its way to the drives."""
        params = self.params
        delay = params.latency + self._late
        if params.jitter:
            delay += params.jitter * self._jitter.random()
        arrival = int(self.physics.step) + math.ceil(delay / params.timestep - 1e-9)
        self._drives.send(self.command, arrival)

    def advance(self) -> None:
        """Simulate to the next tick."""
        self._external.fill(0.0)
        self._clear_record()
        self._simulate(self._steps, pushed=True)

    def damp(self) -> None:
        """Simulate one tick with the drives in damping and no external force."""
        self._drives.damp()
        self._external.fill(0.0)
        self._clear_record()
        self._simulate(self._steps)

    def freeze(self) -> None:
        """Copy the state of the simulator and the random streams to the declared state."""
        import mujoco

        mujoco.mj_getState(
            self._model, self._data, self.physics.integration, mujoco.mjtState.mjSTATE_INTEGRATION
        )
        self._streams.save(self.physics.random)

    def thaw(self) -> None:
        """Restore both from the declared state, and recompute what depends on them."""
        import mujoco

        mujoco.mj_setState(
            self._model, self._data, self.physics.integration, mujoco.mjtState.mjSTATE_INTEGRATION
        )
        self._streams.load(self.physics.random)
        self._step1(self._model, self._data)

    def metrics(self) -> Mapping[str, Metric]:
        """The values that were drawn from the seed."""
        return {
            "robot_friction": float(self._variation.friction),
            "robot_mass_kg": float(self._robot.total_mass * self._variation.mass),
            "robot_contact_stiffness": float(self._variation.contact_stiffness),
        }

    def _simulate(self, steps: int, *, pushed: bool = False) -> None:
        """Simulate physics steps; afterwards all derived quantities are up to date."""
        model, data, record = self._model, self._data, self.record
        step = int(self.physics.step)
        for _ in range(steps):
            np.add(self._position, self._sensors.encoder_offset, out=self._encoder)
            self._drives.joint_torque(step, self._encoder, self._velocity, self._ctrl)
            if pushed:
                self._apply_push()
            self._step2(model, data)
            self._sensors.watch_switches(step, self._vertical, record)
            np.add(record.load, self._load, out=record.load)
            np.add(record.accelerometer, self._accelerometer, out=record.accelerometer)
            allowed = 0.0
            for point in self._load:
                allowed += point.item(0)
            if self._contacts.item(0) > allowed:
                record.forbidden += 1
            self._step1(model, data)
            lower, upper = self._limits
            np.subtract(lower, self._position, out=self._excess)
            np.maximum(record.violation, self._excess, out=record.violation)
            np.subtract(self._position, upper, out=self._excess)
            np.maximum(record.violation, self._excess, out=record.violation)
            step += 1
        record.steps += steps
        self.physics.step[()] = step

    def _apply_push(self) -> None:
        """Apply the external force at its point of its body, which moves with the body."""
        force = self.push.force
        fx, fy, fz = force.item(0), force.item(1), force.item(2)
        if fx == fy == fz == 0.0:
            return
        index = int(self.push.point)
        if not 0 <= index < len(self._points):
            raise IndexError(
                f"push at point {index}; {self._robot.name} has {len(self._points)}: "
                + ", ".join(self._robot.points)
            )
        place, centre, wrench = self._points[index]
        x, y, z = (place.item(k) - centre.item(k) for k in range(3))
        wrench[0], wrench[1], wrench[2] = fx, fy, fz
        wrench[3], wrench[4], wrench[5] = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx

    def _clear_record(self) -> None:
        """Clear the record for a new tick, except for the memory of the switches."""
        record = self.record
        record.steps[()] = 0
        record.forbidden[()] = 0
        for total in (record.load, record.accelerometer, record.violation, record.overload):
            total.fill(0.0)
        record.saturated.fill(0)
        for high in (record.torque_high, record.speed_high):
            high.fill(-np.inf)
        for low in (record.torque_low, record.speed_low):
            low.fill(np.inf)


def _nearest_step(period: float, timestep: float) -> float:
    """The largest step [s] up to ``timestep`` that divides the period; one of few digits if such a
    step is near."""
    count = max(1, math.ceil(period / timestep))
    steps = [period / k for k in range(count, 2 * count + 1)]
    return next((step for step in steps if abs(step * 1e5 - round(step * 1e5)) < 1e-9), steps[0])
