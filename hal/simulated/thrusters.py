"""Thrusters of a simulated robot: delayed commands, limits, and a first-order lag.

A thruster is an actuator of MuJoCo on a site, ``thruster/<name>``, whose axis is the site's z: the force along it and the
moment about it are proportional to the thrust. MuJoCo integrates the lag exactly, so thrust is part of its state. The
actuators of thrusters come behind those of the joints' motors.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...blocks.signals import CommandMode, ThrustCommand, ThrusterState
from ...mathematics.arrays import Array1D, Indices1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.signals import Field, Signal
from ...runtime.language.steps import signal_call
from .state import DriveState

if TYPE_CHECKING:
    from mujoco import MjData, MjModel, MjSpec

    from .variation import Variation


class ThrustQueue(Signal):
    """The thrust that the commands in the drives and on their way ask for: see ``DriveState``."""

    thrust = Field(("n_queue", "n_thrusters"), unit="N", text="asked of each thruster")


@kernel
def send_thrust(command: ThrustCommand, commands: DriveState, queue: ThrustQueue) -> None:
    """Put the thrust beside the joint command that was sent last."""
    slot = (commands.active + commands.pending) % commands.due.shape[0]
    queue.thrust[slot, :] = command.thrust


@kernel
def give_thrust(commands: DriveState, queue: ThrustQueue, most: Array1D, thrust: Array1D) -> None:
    """Write what the active command asks of the thrusters, from nothing to ``most``, to ``thrust``, each
    (n_thrusters,) [N]; nothing in any mode but ``ACTIVE``."""
    active = commands.active
    for k in range(most.shape[0]):
        asked = queue.thrust[active, k]
        thrust[k] = min(max(asked, 0.0), most[k])
    if commands.mode[active] != CommandMode.ACTIVE:
        thrust[:] = 0.0


@kernel
def read_thrust(asked: Array1D, lagged: Array1D, place: Indices1D, state: ThrusterState) -> None:
    """Publish the thrust [N]: what is ``asked`` of each, (n_thrusters,), or where that has a ``place`` from 0 among
    those with a lag, the element of ``lagged``."""
    for k in range(asked.shape[0]):
        state.thrust[k] = lagged[place[k]] if place[k] >= 0 else asked[k]


class SimulatedThrusters:
    """Lets the thrusters of a robot follow commands, which take as long as joint commands do.

    Args:
        robot: the description.
        model, data: the simulator's.
        commands: the joint commands in the drives and on their way.
        queue: the thrust that goes with each of them.
    """

    def __init__(
        self, robot: RobotDescription, model: MjModel, data: MjData, commands: DriveState,
        queue: ThrustQueue,
    ) -> None:  # fmt: skip
        self._robot, self._model, self._data = robot, model, data
        self._commands, self._queue = commands, queue

    def send_call(self, command: ThrustCommand) -> KernelCall:
        """Return the call that sends a command with the joint command that was sent before."""
        return signal_call(send_thrust, command, self._commands, self._queue)

    def follow_call(self) -> KernelCall:
        """Lets the active command act in the next physics step."""
        most = np.array([each.max_thrust for each in self._robot.thrusters.values()])
        thrust = self._data.ctrl[len(self._robot.joints) :]
        return signal_call(give_thrust, self._commands, self._queue, most, thrust)

    def read_call(self, state: ThrusterState) -> KernelCall:
        """Return the call that publishes the present thrust, as from rotor speeds: without the factors that the seed
        draws."""
        first = len(self._robot.joints)
        place = np.array(self._model.actuator_actadr[first:], np.int64)
        return signal_call(read_thrust, self._data.ctrl[first:], self._data.act, place, state)


def add_thrusters(
    spec: MjSpec, bodies: Mapping[str, Any], robot: RobotDescription, variation: Variation
) -> None:
    """Add a site and an actuator for every thruster; the ``bodies`` of the links and the joints' motors are there."""
    import mujoco

    links = [link.name for link in robot.links]
    for k, (name, thruster) in enumerate(robot.thrusters.items()):
        longer = variation.factor(variation.link_length, links.index(thruster.link))
        site = f"thruster/{name}"
        bodies[thruster.link].add_site(
            name=site, pos=longer * np.array(thruster.position), quat=_from_z(thruster.axis)
        )
        share = variation.factor(variation.thrust, k)
        actuator = spec.add_actuator(
            name=site, target=site, trntype=mujoco.mjtTrn.mjTRN_SITE,
            gear=[0.0, 0.0, share, 0.0, 0.0, share * thruster.torque_ratio],
            ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE, ctrlrange=[0.0, thruster.max_thrust],
        )  # fmt: skip
        actuator.set_to_motor()
        if thruster.time_constant > 0.0:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = thruster.time_constant


def _from_z(axis: tuple[float, float, float]) -> list[float]:
    """Return the quaternion w, x, y, z that turns z to a unit ``axis`` the shortest way."""
    x, y, z = axis
    if z < -1.0 + 1e-12:
        return [0.0, 1.0, 0.0, 0.0]
    length = float(np.sqrt(2.0 * (1.0 + z)))
    return [0.5 * length, -y / length, x / length, 0.0]
