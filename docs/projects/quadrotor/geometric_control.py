"""The controller: thrust of every rotor from where the quadrotor is and where it should be."""

from collections.abc import Iterable
from enum import IntEnum

import numpy as np

from aloft import Block, Field, Input, Output, Parameters, Signal, State, live_parameter
from aloft.blocks.signals import BaseState, ThrustCommand, ThrusterState
from aloft.mathematics.arrays import Array1D, Array2D
from aloft.mathematics.elementary import sincos
from aloft.mathematics.kernel import kernel
from aloft.mathematics.linear_algebra import multiply_vector
from aloft.mathematics.rotations import to_matrix
from aloft.runtime.language.block import Context, UnmetRequirement

GRAVITY = 9.81


class FlightMode(IntEnum):
    """The quantity that the controller follows."""

    OFF = 0
    """Nothing: the rotors are off."""
    TRACK = 1
    """The position, with the heading."""
    TURN = 2
    """The orientation, with the given thrust."""


class FlightTarget(Signal):
    """The desired motion of the quadrotor."""

    mode = Field(dtype="int64", values=FlightMode, text="see FlightMode")
    position = Field(3, unit="m", frame="world", text="base origin")
    velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    acceleration = Field(3, unit="m/s^2", frame="world", text="its acceleration")
    heading = Field(unit="rad", frame="world", text="heading")
    orientation = Field(4, text="quaternion x, y, z, w")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="angular velocity")
    angular_acceleration = Field(3, unit="rad/s^2", frame="body", text="its rate of change")
    thrust = Field(unit="m/s^2", text="thrust for the mass, in the mode TURN")


class Airframe(Signal):
    """The body, and what its rotors do to it."""

    mass = Field(unit="kg", text="of the robot")
    inertia = Field((3, 3), unit="kg m^2", frame="body", text="about the centre of mass")
    wrench = Field((4, "n_thrusters"), text="force along the body's z and moments for each newton")
    share = Field(("n_thrusters", 4), text="thrusts for such a force and moments")
    most = Field("n_thrusters", unit="N", text="most that each gives")


class FlightScratch(Signal):
    """Scratch memory of one tick."""

    rotation = Field((3, 3), text="R")
    wanted = Field((3, 3), text="R_d")
    turned = Field((3, 3), text="R^T R_d")
    force = Field(3, text="wanted force for the mass, world")
    attitude_error = Field(3, text="e_R")
    rate_error = Field(3, text="e_W")
    forward = Field(3, text="R^T R_d W_d")
    turning = Field(3, text="wanted angular acceleration, body")
    momentum = Field(3, text="J W")
    wrench = Field(4, text="wanted force along z and moments")
    thrust = Field("n_thrusters", text="thrusts that give it")


class Disturbance(Signal):
    """The estimate of unknown forces from lasting position errors."""

    acceleration = Field(3, unit="m/s^2", frame="world", text="that makes up for them")


class GeometricController(Block):
    """Tracks position and heading, or an orientation, on SE(3).

    T. Lee, M. Leok, N. H. McClamroch: Geometric tracking control of a quadrotor UAV on SE(3), CDC 2010. With errors
    e_x and e_v of position and velocity, the wanted force for the mass is a = -k_x e_x - k_v e_v + g + x_d''.
    The body's z is to point along it, and its x towards the heading, which is R_d; the thrust is m a . R e_3.
    The moments are::

        e_R = (R_d^T R - R^T R_d)^v / 2,   e_W = W - R^T R_d W_d
        M = J (-k_R e_R - k_W e_W) + W x J W - J (W x R^T R_d W_d - R^T R_d W_d')

    In the mode ``TURN`` R_d and the thrust are given. W_d is zero while a position is tracked. Gains are for
    unit mass and inertia, so they suit any airframe: k_x = w^2, k_v = 2 d w and the same of the attitude. While a
    position is tracked an integral of e_x, at most ``most_trim``, makes up for rotors and masses that differ.

    Thrusts follow from force and moments by the rotors' places. Where one would be beyond its limits the
    force gives way to the moments; where that does not suffice the moment about z does, then the others.
    Rotors that lag are asked for ``lead`` times the change that is missing.
    """

    class Params(Parameters):
        position_bandwidth: float = live_parameter(
            2.5, unit="rad/s", gt=0, text="w of the position"
        )
        attitude_bandwidth: float = live_parameter(
            14.0, unit="rad/s", gt=0, text="w of the attitude"
        )
        heading_bandwidth: float = live_parameter(
            5.0, unit="rad/s", gt=0, text="w about the body's z"
        )
        damping: float = live_parameter(0.8, gt=0, text="damping ratio d of both")
        steepest: float = live_parameter(
            10.0, unit="m/s^2", gt=0, text="most of -k_x e_x - k_v e_v"
        )
        trim_rate: float = live_parameter(1.0, unit="1/s", ge=0, text="of the integral, beside k_x")
        most_trim: float = live_parameter(2.0, unit="m/s^2", ge=0, text="most of it on each axis")
        lead: float = live_parameter(
            2.0, ge=1, text="how much faster than by themselves rotors follow"
        )

    Constants = Airframe
    Scratch = FlightScratch
    needs = ("robot", "floating base")
    params: Params
    constants: Airframe
    scratch: FlightScratch
    base = Input(BaseState, text="pose and velocity")
    target = Input(FlightTarget, text="where it should be")
    thrusters = Input(ThrusterState, text="what the rotors give")
    thrust = Output(ThrustCommand, text="what they are to give")
    disturbance = State(Disturbance, text="the integral")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Require a rigid body whose thrusters push along its z and turn it about all axes."""
        robot = context.robot
        if robot.joints:
            yield UnmetRequirement(f"{robot.name} has joints", fix="weld: ['*'] in its description")
        elif any(each.axis[2] < 0.999 for each in robot.thrusters.values()) or (
            np.linalg.matrix_rank(wrenches(robot)) < 4
        ):
            yield UnmetRequirement(
                f"the thrusters of {robot.name} do not lift it along its z and turn it about all axes",
                expected="four or more along z, apart from each other, with torque_ratio of both signs",
                found=f"{len(robot.thrusters)} thrusters",
            )

    def prepare(self) -> None:
        """Read the airframe."""
        c, body = self.constants, self.robot.links[0]
        xx, yy, zz, xy, xz, yz = body.inertia
        c.mass = self.robot.total_mass
        c.inertia[:] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        c.wrench[:] = wrenches(self.robot)
        c.share[:] = np.linalg.pinv(c.wrench)
        c.most[:] = [each.max_thrust for each in self.robot.thrusters.values()]

    @kernel
    @staticmethod
    def step(
        base: BaseState, target: FlightTarget, thrusters: ThrusterState, thrust: ThrustCommand,
        disturbance: Disturbance, params: Params, constants: Airframe, scratch: FlightScratch,
        period: float,
    ) -> None:  # fmt: skip
        if target.mode == FlightMode.OFF:
            thrust.thrust[:] = 0.0
            return
        c, s = constants, scratch
        to_matrix(base.orientation, s.rotation)
        if target.mode == FlightMode.TURN:
            to_matrix(target.orientation, s.wanted)
            s.wrench[0] = c.mass * target.thrust
        else:
            w, size = params.position_bandwidth, 0.0
            s.force[:] = w**2 * (target.position - base.position)
            s.force[:] += 2.0 * params.damping * w * (target.velocity - base.linear_velocity)
            size = (s.force @ s.force) ** 0.5
            s.force[:] = min(1.0, params.steepest / max(size, 1e-9)) * s.force
            most = params.most_trim
            for k in range(3):
                error = target.position[k] - base.position[k]
                trim = disturbance.acceleration[k] + period * params.trim_rate * w**2 * error
                disturbance.acceleration[k] = min(max(trim, -most), most)
            s.force[:] += target.acceleration + disturbance.acceleration
            s.force[2] = max(s.force[2] + GRAVITY, 0.2 * GRAVITY)
            point(s.force, target.heading, s.wanted)
            along = 0.0
            for k in range(3):
                along += s.force[k] * s.rotation[k, 2]
            s.wrench[0] = c.mass * along
        s.turned[:, :] = s.rotation.T @ s.wanted
        s.forward[:] = s.turned @ target.angular_velocity
        s.rate_error[:] = base.angular_velocity - s.forward
        # e_R is half of the vee of (R^T R_d)^T - R^T R_d.
        s.attitude_error[0] = 0.5 * (s.turned[1, 2] - s.turned[2, 1])
        s.attitude_error[1] = 0.5 * (s.turned[2, 0] - s.turned[0, 2])
        s.attitude_error[2] = 0.5 * (s.turned[0, 1] - s.turned[1, 0])
        s.turning[:] = s.turned @ target.angular_acceleration
        for k in range(3):
            w = params.heading_bandwidth if k == 2 else params.attitude_bandwidth
            s.turning[k] -= w**2 * s.attitude_error[k]
            s.turning[k] -= 2.0 * params.damping * w * s.rate_error[k]
        x, y, z = base.angular_velocity[0], base.angular_velocity[1], base.angular_velocity[2]
        s.turning[0] -= y * s.forward[2] - z * s.forward[1]
        s.turning[1] -= z * s.forward[0] - x * s.forward[2]
        s.turning[2] -= x * s.forward[1] - y * s.forward[0]
        s.momentum[:] = c.inertia @ base.angular_velocity
        s.wrench[1:4] = c.inertia @ s.turning
        s.wrench[1] += y * s.momentum[2] - z * s.momentum[1]
        s.wrench[2] += z * s.momentum[0] - x * s.momentum[2]
        s.wrench[3] += x * s.momentum[1] - y * s.momentum[0]
        allocate(s.wrench, c.share, c.most, s.thrust)
        thrust.thrust[:] = thrusters.thrust + params.lead * (s.thrust - thrusters.thrust)


def wrenches(robot) -> np.ndarray:
    """Compute force along z [N] and moments about the centre of mass [N m] for each newton of every
    thruster, (4, n)."""
    com, columns = np.array(robot.links[0].com), []
    for each in robot.thrusters.values():
        axis = np.array(each.axis)
        moment = np.cross(np.array(each.position) - com, axis) + each.torque_ratio * axis
        columns.append([axis[2], *moment])
    return np.array(columns).reshape(-1, 4).T


@kernel
def point(force: Array1D, heading: float, out: Array2D) -> None:
    """Compute the rotation (3, 3) whose z is along the ``force`` and whose x is towards the
    ``heading`` [rad]."""
    size = (force @ force) ** 0.5
    z0, z1, z2 = force[0] / size, force[1] / size, force[2] / size
    sine, cosine = sincos(heading)
    # y = z x heading, x = y x z
    y0, y1, y2 = -z2 * sine, z2 * cosine, z0 * sine - z1 * cosine
    size = (y0 * y0 + y1 * y1 + y2 * y2) ** 0.5
    y0, y1, y2 = y0 / size, y1 / size, y2 / size
    out[0, 0], out[1, 0], out[2, 0] = y1 * z2 - y2 * z1, y2 * z0 - y0 * z2, y0 * z1 - y1 * z0
    out[0, 1], out[1, 1], out[2, 1] = y0, y1, y2
    out[0, 2], out[1, 2], out[2, 2] = z0, z1, z2


@kernel
def force_limits(
    wrench: Array1D, share: Array2D, most: Array1D, tilting: float, turning: float
) -> tuple[float, float]:
    """Return the least and the largest force [N] along z with which rotors give ``tilting`` times
    the moments about x and y and ``turning`` times that about z; the first is above the second
    where there is none."""
    low, high = -1e9, 1e9
    for k in range(most.shape[0]):
        moments = tilting * (share[k, 1] * wrench[1] + share[k, 2] * wrench[2])
        moments += turning * share[k, 3] * wrench[3]
        low = max(low, -moments / share[k, 0])
        high = min(high, (most[k] - moments) / share[k, 0])
    return low, high


@kernel
def allocate(wrench: Array1D, share: Array2D, most: Array1D, thrust: Array1D) -> None:
    """Compute the ``thrust`` [N] (n,) of rotors that give force and moments ``wrench`` (4,), as far
    as they can."""
    tilting, turning = 1.0, 1.0
    low, high = force_limits(wrench, share, most, 1.0, 1.0)
    if low > high:
        low, high = force_limits(wrench, share, most, 1.0, 0.0)
        gives = 0.0  # halve the interval of the largest share that fits, again and again
        takes = 1.0
        alone = low <= high  # the moments about x and y fit, and only that about z is too much
        for _ in range(20):
            middle = 0.5 * (gives + takes)
            low, high = force_limits(
                wrench, share, most, 1.0 if alone else middle, middle if alone else 0.0
            )
            if low <= high:
                gives = middle
            else:
                takes = middle
        tilting, turning = 1.0 if alone else gives, gives if alone else 0.0
        low, high = force_limits(wrench, share, most, tilting, turning)
    wrench[0] = min(max(wrench[0], low), high)
    wrench[1], wrench[2] = tilting * wrench[1], tilting * wrench[2]
    wrench[3] = turning * wrench[3]
    multiply_vector(share, wrench, thrust)
    for k in range(most.shape[0]):
        thrust[k] = min(max(thrust[k], 0.0), most[k])
