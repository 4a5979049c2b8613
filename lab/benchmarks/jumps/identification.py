"""Errors of a calibration on robots that the trial ``real`` draws.

Each robot sways over its standing feet (``extensions/commissioning/graphs/calibrate.yaml``), and ``aloft robot calibrate`` finds what it is like from that alone.
The truth is what the simulator drew (``studies/oracle``). Torque constants are compared by their ratio to the mean one, because no motion
tells their common scale.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ....extensions.commissioning.identification.calibration import Calibration, Value
from ....extensions.commissioning.identification.robot_calibration import (
    calibration_from,
    swayed,
)
from ....mathematics.arrays import Array
from ....runtime.graph import Graph, load
from ....studies.batch.jobs import job_results
from ...studies.oracle import oracle_values
from ..rows import Row
from .real_robot import FOLDER

SEEDS = range(97840, 97860)
"""The robots; nothing is tuned on them."""


@dataclass(frozen=True)
class Quantity:
    """A calibrated quantity with its unit and its largest good error."""

    name: str
    unit: str
    goal: float | None = None


QUANTITIES = (
    Quantity("friction, a joint", "%", 10.0),
    Quantity("torque constant, a motor", "%", 2.0),
    Quantity("age of the gyroscope", "ms", 0.2),
    Quantity("place of the IMU, an axis", "mm", 3.0),
    Quantity("angle of the IMU, an axis", "deg", 0.3),
    Quantity("resistance of the pack", "%", 10.0),
    Quantity("age of the accelerometer", "ms"),
    Quantity("age of joint velocities", "ms"),
    Quantity("damping, a joint", "%"),
    Quantity("saturation", "% of the torque"),
    Quantity("load friction", "% of the torque"),
    Quantity("rotors, one factor", "%"),
    Quantity("play, a gear", "mrad"),
)

Errors = tuple[list[float], list[float]]
"""Errors, and the standard deviations that are claimed, in the quantity's unit."""


def identification(seeds: Sequence[int] = SEEDS, workers: int = 0) -> list[Row]:
    """Measure for each quantity the root mean square of its errors over the robots.

    ``results/real_robot/identification.json`` has each robot that is done.

    Args:
        seeds: of the robots.
        workers: processes; 0: as many as there are processors.

    Raises:
        RuntimeError: a robot did not sway to the end.
    """
    robots: dict[int, dict[str, Errors]] = {}
    FOLDER.mkdir(parents=True, exist_ok=True)
    with closing(job_results(_errors_of_robot, list(seeds), workers=workers)) as results:
        for result in results:
            if result.error:
                raise RuntimeError(result.error)
            robots[seeds[result.index]] = result.value
            text = json.dumps({"robots": dict(sorted(robots.items()))}, indent=1)
            (FOLDER / "identification.json").write_text(text + "\n", encoding="utf-8")
    return [
        row_of(quantity, [each[quantity.name] for each in robots.values()])
        for quantity in QUANTITIES
    ]


def row_of(quantity: Quantity, robots: Sequence[Errors]) -> Row:
    """Return the row of a quantity: the shares of its errors within the goal and within the claim."""
    errors = np.concatenate([each for each, _ in robots])
    claimed = np.concatenate([each for _, each in robots])
    size = np.abs(errors)
    note = (
        f"{len(robots)} robots; mean error {errors.mean():.2g}, claimed {_rms(claimed):.2g}, "
        f"{np.mean(size <= 2.0 * claimed):.0%} within two of them"
    )
    if quantity.goal is not None:
        note += f"; {np.mean(size <= quantity.goal):.0%} within the goal"
    return Row(quantity.name, _rms(errors), quantity.unit, goal=quantity.goal, note=note)


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values**2)))


def _errors_of_robot(seed: int) -> dict[str, Errors]:
    graph = load("aloft:commissioning/calibrate").with_seed(seed)
    return errors_of(calibration_from(swayed(graph)), graph)


def errors_of(found: Calibration, graph: Graph) -> dict[str, Errors]:
    """Compute a calibration's errors for the robot that a graph draws, by the name of the quantity."""
    robot = graph.checked.robot
    assert robot is not None
    true = oracle_values(graph)

    def ratio(values: Mapping[str, Value], drawn: Array) -> Errors:
        """Express errors as percentages of the truth."""
        return _errors([*values.values()], drawn, 100.0 / drawn)

    def one(value: Value, drawn: float, scale: float) -> Errors:
        return _errors([value], drawn, scale)

    def friction(name: str, known: Array) -> Array:
        beyond: Array = np.array([true[name][joint.name] for joint in robot.joints])
        return known + beyond

    constants = np.array([*true["robot.motor_model.torque_constant"].values()])
    rotors = float(np.mean([*true["dynamics.rotor_inertia"].values()]))
    angles = true["timing.position"]
    result = {
        "friction, a joint": ratio(
            found.friction, friction("weight.friction", robot.motors.friction)
        ),
        "damping, a joint": ratio(found.damping, friction("weight.damping", robot.motors.damping)),
        "torque constant, a motor": ratio(found.torque_constant, constants / constants.mean()),
        "age of the gyroscope": one(found.gyro_age, true["timing.rate"] - angles, 1e3),
        "age of the accelerometer": one(
            found.accelerometer_age, true["timing.force"] - angles, 1e3
        ),
        "age of joint velocities": one(found.velocity_age, true["timing.velocity"] - angles, 1e3),
        "place of the IMU, an axis": _errors(found.imu_position, true["timing.imu_position"], 1e3),
        "angle of the IMU, an axis": _errors(
            found.imu_rotation, true["timing.imu_rotation"], math.degrees(1.0)
        ),
        "saturation": one(found.saturation, true["robot.motor_model.saturation"], 100.0),
        "load friction": one(found.load_friction, true["robot.motor_model.load_friction"], 100.0),
        "rotors, one factor": one(found.rotor_inertia, rotors, 100.0 / rotors),
        "play, a gear": _errors([*found.play.values()], true["timing.play"], 1e3),
    }
    if found.resistance is not None:
        resistance = true["safety.pack_resistance"]
        result["resistance of the pack"] = one(found.resistance, resistance, 100.0 / resistance)
    return result


def _errors(found: Sequence[Value], drawn: ArrayLike, scale: ArrayLike) -> Errors:
    values, claimed = np.array([(each.value, each.std) for each in found]).T
    return list((values - drawn) * scale), list(claimed * scale)
