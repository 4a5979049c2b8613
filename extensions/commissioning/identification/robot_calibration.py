"""Calibration of a robot from a run in which it sways, in a graph or from a recording.

``calibrated_fragment(graph, "sway.yaml")`` runs a graph in this process and returns the text that
``aloft robot calibrate`` writes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from ....robots.robot_description import RobotDescription
from ....runtime.graph import Graph
from ....runtime.language.errors import AloftError
from .calibration import Calibration, calibrate_robot, fragment
from .identification import IdentificationError, MeasuredRun

PHASE = "phase.phase.phase"


@dataclass(frozen=True)
class SwayedRun:
    """The measurements of one run for the calibration, one row a tick.

    Attributes:
        robot: as it is described.
        motion: the measurements.
        voltage: at the drives (n, n_motors) [V].
        asked: the commanded joint torques (n, n_joints) [N m].
        feedback: where the drives add torques of their own (n,).
        phase: of the controller (n,); a robot whose graph tells none stands.
    """

    robot: RobotDescription
    motion: MeasuredRun
    voltage: Array
    asked: Array
    feedback: NDArray[np.bool_]
    phase: NDArray[np.int64]


def swayed(
    graph: Graph, block: str = "robot", command: str = "safety.command", whole: bool = True
) -> SwayedRun:
    """Run a graph.

    Args:
        block: the path of the robot's block.
        command: the port with its commands.
        whole: a run that does not succeed is of no use.

    Raises:
        AloftError: the run failed, or did not succeed.
        KeyError: there is no such block or port.
    """
    result = graph.run()
    result.raise_if_failed()
    if whole and not result.success:
        raise AloftError(f"the robot did not sway to the end: {result.reason}")
    assert graph.checked.robot is not None
    return read_run(result.signal, result.period, graph.checked.robot, block, command)


def read_run(
    signals: Callable[[str], Any], period: float, robot: RobotDescription, block: str, command: str
) -> SwayedRun:
    """Pick the signals of a run that the calibration needs, by their names. Raises ``KeyError``
    where there is no such block or port."""
    position = signals(f"{block}.joints.position")
    motion = MeasuredRun(
        period, position, signals(f"{block}.joints.velocity"), signals(f"{block}.joints.torque"),
        signals(f"{block}.imu.angular_velocity"), signals(f"{block}.imu.specific_force"),
        np.zeros((len(position), 3)), signals(f"{block}.contacts.closed"),
    )  # fmt: skip
    gains = signals(f"{command}.stiffness"), signals(f"{command}.damping")
    try:
        phase = signals(PHASE)
    except KeyError:
        phase = np.zeros(len(position), dtype=np.int64)
    return SwayedRun(
        robot, motion, signals(f"{block}.health.voltage"), signals(f"{command}.torque"),
        (gains[0] != 0.0).any(axis=1) | (gains[1] != 0.0).any(axis=1), phase,
    )  # fmt: skip


def calibration_from(run: SwayedRun, weighed: float | None = None) -> Calibration:
    """Calibrate from a run, whose robot's mass [kg] may be known from a balance. Raises
    ``AloftError``."""
    try:
        return calibrate_robot(run.robot, run.motion, run.voltage, run.asked, run.feedback, weighed)
    except IdentificationError as error:
        raise AloftError(str(error)) from error


def calibrated_fragment(graph: Graph, source: str) -> str:
    """Let the robot of a graph sway, and return the text of a graph's ``set`` with what was found.

    Args:
        source: is named as where the values come from.

    Raises:
        AloftError: the run failed, or does not tell what is looked for.
    """
    run = swayed(graph)
    return fragment(run.robot, calibration_from(run), source)
