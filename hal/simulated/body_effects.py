"""How links, joints, soles, pack and surroundings of a simulated robot differ from its description: parameters."""

from __future__ import annotations

from ...runtime.language.parameters import Parameters, parameter


class LinkEffects(Parameters):
    """How the links differ from the description, besides a common factor on all masses."""

    mass_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor on the mass of every link"
    )
    com_spread: float = parameter(
        0.0, unit="m", ge=0.0, text="spread of the offset of every link's CoM, per axis"
    )
    inertia_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of a further factor on the inertia of every link"
    )


class JointEffects(Parameters):
    """How joints and rotors differ from the description, besides the common factor ``joint_friction``."""

    friction_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor on friction and damping of every joint"
    )
    rotor_inertia: float = parameter(1.0, gt=0.0, text="factor on the inertia of all rotors")
    rotor_inertia_spread: float = parameter(
        0.0, ge=0.0, lt=1.0, text="spread of the factor, per motor"
    )


class SoleParameters(Parameters):
    """Rubber under the contact points: contacts as soft and as bouncing as these say."""

    time_constant: float = parameter(
        0.008, unit="s", gt=0.0, le=0.1, text="in which a contact settles; stiff ones take 4 ms"
    )
    damping_ratio: float = parameter(1.0, gt=0.0, le=2.0, text="below 1 the soles bounce")


class CableParameters(Parameters):
    """A cable to the robot's base, which pulls from the first tick on."""

    pull: float = parameter(unit="N", ge=0.0, text="its horizontal force, in a drawn direction")
    weight: float = parameter(0.0, unit="N", ge=0.0, text="what hangs of it on the robot")


class GantryParameters(Parameters):
    """A gantry: the robot hangs from a rope at its base when the run begins, and is let down."""

    height: float = parameter(0.04, unit="m", ge=0.0, le=1.0, text="of the soles above the ground")
    lower_after: float | None = parameter(
        0.5, unit="s", ge=0.0,
        text="when it is let down, from the first command on; none: when somebody says so",
    )  # fmt: skip
    speed: float | None = parameter(
        0.08, unit="m/s", gt=0.0, text="at which it is let down; none: it is dropped"
    )
    slack: float = parameter(
        0.5, unit="m", ge=0.0, text="by which the rope is too long to pull once the robot stands"
    )
    rope: float = parameter(1.0, unit="m", gt=0.0, text="length of the rope while the robot hangs")
    above_com: float = parameter(
        0.15, unit="m", ge=0.0, text="where it is tied to the base: above the robot's CoM"
    )
    stretch: float = parameter(
        0.005, unit="m", gt=0.0, text="by which the robot's weight makes it longer"
    )


class BatteryParameters(Parameters):
    """A pack; the defaults are estimates for four lithium-polymer cells of 2.2 A h."""

    open_voltage: float = parameter(16.0, unit="V", gt=0.0, text="without load, at the start")
    resistance: float = parameter(0.03, unit="ohm", ge=0.0, text="what a load sees at once")
    recovery_resistance: float = parameter(
        0.01, unit="ohm", ge=0.0, text="what builds up under load and recovers after it"
    )
    recovery_time: float = parameter(
        10.0, unit="s", gt=0.0, text="time constant of building up and recovering"
    )
    capacity: float = parameter(7920.0, unit="A s", gt=0.0, text="charge of the full pack")
    fall: float = parameter(
        2.4, unit="V", ge=0.0, text="by which the open voltage falls from full to empty"
    )
    board_power: float = parameter(15.0, unit="W", ge=0.0, text="what computer and boards draw")
    rated_voltage: float = parameter(
        14.8, unit="V", gt=0.0,
        text="voltage at which the motors reach the speeds of the robot's description",
    )  # fmt: skip
    winding_resistance: float = parameter(
        0.2, unit="ohm", ge=0.0, text="of a motor, as its torque current sees it"
    )
    torque_constant: float = parameter(
        0.35, unit="N m/A", gt=0.0, text="torque at the output for each ampere"
    )
