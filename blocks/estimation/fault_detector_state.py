"""What ``FaultDetector`` is given and keeps: its parameters, state, constants and scratch."""

from __future__ import annotations

from enum import IntEnum

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal


class Suspect(IntEnum):
    """The sensor or motor that disagrees with all the rest."""

    NONE = 0
    GYROSCOPE = 1
    """It turns otherwise than the base over the feet that stand."""
    ACCELEROMETER = 2
    """Its direction is not that of the force with which the legs push."""
    TORQUE = 3
    """A joint's torque is off its command."""
    ENCODER = 4
    """A joint's angle changes otherwise than its speed implies."""
    SWITCHES = 5
    """None is closed under feet that carry the robot."""


class Stop(IntEnum):
    """Why a run was ended."""

    NONE = 0
    GYROSCOPE = 1
    """An axis of the gyroscope reads otherwise than the base turns over its feet."""
    GRAVITY = 2
    """At rest the accelerometer does not read gravity, away from the feet."""
    PUSH = 3
    """In squat, thrust or landing the accelerometer does not read what the legs push."""
    SUSPECT = 4
    """A suspect was found, and the robot was about to jump; or it stands by what it was."""
    LEAN = 5
    """Before lift-off the ground under the feet seems to tip: the attitude is wrong."""
    SWITCHES = 6
    """In squat or thrust no switch is closed under load."""
    LANDED = 7
    """In flight the accelerometer reads a landing of which no switch tells."""
    FALL = 8
    """The robot falls after its touchdown."""


class FaultDetectorParams(Parameters):
    """The parameters of ``FaultDetector``."""

    window: float = parameter(
        0.2, unit="s", gt=0.0, text="time constant in which a disagreement is forgotten"
    )
    force_window: float = parameter(0.4, unit="s", gt=0.0, text="the same of forces")
    lateness: float = parameter(
        0.004, unit="s", ge=0.0, text="largest delay of one measurement behind the other"
    )
    gyroscope_error: float = parameter(
        0.08, unit="rad/s", ge=0.0, text="its largest steady error; zero: not judged"
    )
    acceleration_error: float = parameter(
        0.05, ge=0.0, text="largest error of the accelerometer across the weight, in g; zero: not judged",
    )  # fmt: skip
    torque_error: float = parameter(
        0.15,
        ge=0.0,
        text="share by which a joint's torque may be off its command; zero: not judged",
    )
    encoder_error: float = parameter(
        0.1, unit="rad/s", ge=0.0,
        text="largest steady difference of an angle's change and the speed; zero: not judged",
    )  # fmt: skip
    open_time: float = parameter(
        0.15, unit="s", ge=0.0,
        text="time for which all switches may be open under load; zero: not judged",
    )  # fmt: skip
    open_load: float = parameter(
        0.5, gt=0.0, text="from which load on the feet on, in weights of the robot"
    )
    slip_speed: float = parameter(
        0.1, unit="m/s", gt=0.0, text="of points that stand against each other; faster ones slide"
    )
    settle_time: float = parameter(
        0.03, unit="s", ge=0.0, text="for which points have stood before they count"
    )
    rest_speed: float = parameter(
        1.0, unit="rad/s", gt=0.0, text="mean speed of joints below which forces are those of rest"
    )
    gross_rate: float = parameter(
        0.4, unit="rad/s", ge=0.0,
        text="difference of the gyroscope from the feet that ends a run before its thrust, five times as much in it; zero: none",
    )  # fmt: skip
    gross_gravity: float = parameter(
        0.3, ge=0.0,
        text="difference of the accelerometer at rest from gravity over the legs, in g, that does; zero: none",
    )  # fmt: skip
    largest_rate: float = parameter(
        40.0, unit="rad/s", ge=0.0,
        text="reading of the gyroscope, beyond the range of any, that ends a run at once; zero: none",
    )  # fmt: skip
    gross_push: float = parameter(
        0.3, ge=0.0, lt=1.0,
        text="share of what the legs push that the accelerometer must read in squat, thrust and landing, or the run ends; zero: any",
    )  # fmt: skip
    gross_across: float = parameter(
        1.2, ge=0.0,
        text="force along x or y, in weights, by which legs and accelerometer may differ in squat and thrust where the other sign fits; zero: any",
    )  # fmt: skip
    gross_lean: float = parameter(
        0.05, unit="rad", ge=0.0,
        text="by how much the ground may seem to tip before lift-off; zero: any",
    )  # fmt: skip
    gross_open: float = parameter(
        0.02, unit="s", ge=0.0,
        text="time for which all switches may be open under load in squat and thrust; zero: any",
    )  # fmt: skip
    gross_landing: float = parameter(
        1.5, ge=0.0,
        text="reading of the accelerometer's z in flight, in g, that is a landing; zero: none",
    )  # fmt: skip
    falling_rate: float = parameter(
        4.0, unit="rad/s", ge=0.0,
        text="rate of leaning over for `falling_time` after touchdown that is a fall; zero: none",
    )  # fmt: skip
    falling_time: float = parameter(0.02, unit="s", ge=0.0, text="see `falling_rate`")
    suspects_end: bool = parameter(
        True,
        text="whether a suspect other than an encoder ends the run in squat and thrust, switches in the stand, and the gyroscope whenever feet stand",
    )
    gross_time: float = parameter(
        0.004,
        unit="s",
        ge=0.0,
        text="for how long gravity is off, and for how much longer than `lateness` a rate or a push is",
    )


class FaultDetectorState(Signal):
    """The state of ``FaultDetector``."""

    suspect = Field(dtype="int64", values=Suspect, text="the first that was found")
    tick = Field(dtype="int64", text="when")
    place = Field(dtype="int64", text="its axis or joint")
    value = Field(text="its disagreement")
    share = Field(6, text="largest disagreement so far of each suspect, as a share of its limit")
    started = Field(dtype="bool", text="there was a last tick")
    standing = Field(dtype="int64", text="ticks in a row in which the points stood")
    turn = Field(3, unit="rad", text="turn by the gyroscope less turn over the feet")
    rate = Field(3, unit="rad/s", text="the gyroscope's mean")
    slip = Field("n_joints", unit="rad", text="change of the angle less integral of the speed")
    speed = Field("n_joints", unit="rad/s", text="mean speed of each joint")
    position = Field("n_joints", unit="rad", text="angles of the last tick")
    expected = Field("n_joints", unit="N m", text="torques that the last command asks for")
    level = Field("n_joints", unit="N m", text="their mean")
    asked = Field("n_joints", unit="N m", text="the mean of their magnitudes")
    missing = Field("n_joints", unit="N m", text="mean of measured torques less expected ones")
    lacking = Field(3, unit="N", frame="body", text="mean force that the legs lack")
    open = Field(dtype="int64", text="ticks in a row with load and no switch closed")
    gross = Field(
        10,
        dtype="int64",
        text="ticks in a row with a gross error of gyroscope axes, gravity, push, push across, lean, switches, landing, fall",
    )
    ground = Field(3, frame="world", text="normal of the plane of the feet when they first stood")
    grounded = Field(dtype="bool", text="it is known")
    rested = Field(dtype="int64", text="ticks of rest so far")
    stop = Field(dtype="int64", values=Stop, text="why the run was ended")
    stop_tick = Field(dtype="int64", text="when")
    reading = Field(3, text="what the sensor read then, in the unit of its signal")
    right = Field(3, text="what the legs say it should read")


class FaultDetectorConstants(Signal):
    """Constants of the robot's description and the parameters."""

    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    leg_joints = Field(
        ("n_feet", "n_leg_joints"), dtype="int64", text="joints of each foot's leg, then -1"
    )
    peak = Field("n_joints", unit="N m", text="the motors' peak torques at the joints")
    weight = Field(unit="N", text="of the robot")
    fading = Field(2, text="share of a mean that goes in a tick: of all, of forces")
    settling = Field(dtype="int64", text="ticks for which points have stood before they count")
    open_ticks = Field(dtype="int64", text="ticks with load and open switches that are no fault")
    gross_ticks = Field(
        4,
        dtype="int64",
        text="ticks in a row that are borne: of a gross rate, of gravity, of open switches, of a fall",
    )


class FaultDetectorScratch(Signal):
    """Intermediate values of a tick."""

    stands = Field("n_contacts", dtype="bool", text="points that stand")
    arm = Field(("n_contacts", 3), unit="m", text="points from their mean, world axes")
    moved = Field(("n_contacts", 3), unit="m/s", text="their velocities against the base's")
    mean = Field((2, 3), text="of the points and their velocities")
    inertia = Field((3, 3), unit="m^2", text="of the points, as unit masses, about their mean")
    turning = Field(
        (2, 3), unit="rad/s", text="the base's rate over its feet, in world and base axes"
    )
    force = Field(3, unit="N", text="force of a contact point, world axes")
    needed = Field("n_joints", unit="N m", text="torques that the ground gives")
    normal = Field(("n_leg_joints", "n_leg_joints"), text="J' J of a leg, damped")
    solution = Field("n_leg_joints", text="y of a leg")
    lacking = Field(3, unit="N", frame="body", text="force that the legs lack now")
    up = Field(3, text="away from the points that should stand, base axes")
