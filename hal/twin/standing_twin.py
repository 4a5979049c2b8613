"""Makes a twin outside a graph, with memory of its own."""

from __future__ import annotations

from ...robots.robot_description import RobotDescription
from ..bear.configuration import Hardware
from ..simulated.parameters import SimulatorParameters
from ..simulated.plant import Plant
from ..simulated.state import DriveState, PhysicsState, TickRecord
from .faults import Fault
from .twin import Twin


def standing_twin(
    robot: RobotDescription, params: SimulatorParameters, hardware: Hardware,
    tick: float = 0.002, faults: tuple[Fault, ...] = (),
) -> Twin:  # fmt: skip
    """A twin that stands in its gantry.

    Args:
        robot: the description.
        params: world, disturbances and sensors' errors.
        hardware: addresses, directions, offsets and the bus's period.
        tick: the control period [s], to which noise and start phase refer.
        faults: what goes wrong.

    Raises:
        StartError: the robot does not stand as its description says.
    """
    sizes = {**robot.dimensions, **Plant.state_dimensions(params, robot), "n_queue": 2}
    twin = Twin(
        robot, params, hardware, tick, PhysicsState.allocate(sizes), TickRecord.allocate(sizes),
        DriveState.allocate(sizes), faults,
    )  # fmt: skip
    twin.stand()
    return twin
