"""Robots that were drawn and simulated, and how often intervals of ``identify`` contain what is true of them.

::

    python -m aloft.lab.studies.identified_robots            # 200 robots, some minutes
    python -m aloft.lab.studies.identified_robots --robots 20

Each is a double pendulum whose links, rotors, friction, torque constants, offsets and torques' age are drawn about those of its
description. Two logs of 10 s, excited by sums of sines in closed loop, with the encoders' resolution and noise, and noise of the
torques. Integrated by Pinocchio's articulated-body algorithm in steps of half a millisecond; aloft's simulator has no part.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from ...extensions.commissioning.identification.dynamics_fit import fit_dynamics
from ...extensions.commissioning.identification.motion_log import MotionLog
from ...mathematics.arrays import Array
from ...robots.description import find_robot
from ...robots.robot_description import RobotDescription

URDF = """<robot name="double_pendulum">
<link name="world"/>
<link name="upper"><inertial><origin xyz="0 0 -0.15"/><mass value="0.6"/>
<inertia ixx="0.006" iyy="0.006" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0 0 -0.2"/><mass value="0.6"/>
<inertia ixx="0.009" iyy="0.009" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="world"/><child link="upper"/><axis xyz="1 0 0"/>
<limit effort="6" velocity="20"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.25"/><axis xyz="1 0 0"/>
<limit effort="6" velocity="20"/></joint>
</robot>
"""
YAML = """file: double_pendulum.urdf
name: double_pendulum
text: made for a study
base_joint: fixed
profiles:
  rated: {rotor_inertia: 0.002, friction: 0.1, damping: 0.005}
sensors: {imu: false, switches: false}
"""
STEP, PERIOD, DURATION = 5e-4, 2e-3, 10.0
SHARP = 0.02
"""Speed at which Coulomb friction acts in the simulation [rad/s]; the fit does not know it."""
RESOLUTION, ANGLE_NOISE, TORQUE_NOISE = 4e-4, 1e-4, 0.03
NINETY = 1.6449
"""Standard deviations from the middle to the ends of an interval that holds 90 % of a normal distribution."""


def pendulum(folder: Path) -> RobotDescription:
    """Write the description into a folder and read it."""
    (folder / "double_pendulum.urdf").write_text(URDF)
    (folder / "double_pendulum.yaml").write_text(YAML)
    return find_robot(str(folder / "double_pendulum.yaml"))


def drawn(robot: RobotDescription, rng: np.random.Generator) -> tuple[dict[str, Array], object]:
    """Return what is true of a robot, by the kinds of a fit's unknowns, and its Pinocchio model."""
    import pinocchio as pin

    from ...extensions.commissioning.identification.base_parameters import LinkRegressor

    links = LinkRegressor(robot)
    model = links.model
    for k in range(1, model.njoints):
        old = model.inertias[k]
        mass, size = old.mass * np.exp(0.3 * rng.normal()), np.exp(0.15 * rng.normal())
        moment = old.lever * size + 0.01 * rng.normal(size=3)
        scale = mass / old.mass * size**2
        model.inertias[k] = pin.Inertia(mass, moment, old.inertia * scale)
    whole = np.concatenate([model.inertias[k].toDynamicParameters() for k in (1, 2)])
    rotors = np.diag(robot.rotor_matrix).copy()
    rotors[1] *= np.exp(0.4 * rng.normal())
    model.armature = rotors
    truth = {
        "base": links.lumped @ whole, "rotor inertia": rotors[links.told_rotors],
        "coulomb": rng.uniform(0.03, 0.25, 2), "viscous": rng.uniform(0.0, 0.03, 2),
        "load": rng.uniform(0.0, 0.15, 2), "log constant": 0.1 * rng.normal(size=2),
        "offset": 0.02 * rng.normal(size=2),
        # a torque that is held for a sample acts in its middle: half a sample after it is logged
        "age of torques": PERIOD * rng.integers(0, 3, 1) - 0.5 * (PERIOD - STEP),
    }  # fmt: skip
    return truth, model


def simulated_log(
    model: object, truth: dict[str, Array], rng: np.random.Generator, name: str, size: float = 1.0
) -> MotionLog:
    """Return a log of a drawn robot that follows sums of sines with a soft controller."""
    import pinocchio as pin

    data = model.createData()  # type: ignore[attr-defined]
    frequencies = rng.uniform(0.2, 1.8, (4, 2))
    phases, sizes = rng.uniform(0, 2 * np.pi, (4, 2)), size * rng.uniform(0.2, 0.7, (4, 2))
    sizes /= np.sqrt(np.maximum(frequencies, 0.5))
    every = round(PERIOD / STEP)
    q, v, rows, torques = np.zeros(2), np.zeros(2), [], []
    constant = np.exp(truth["log constant"])
    arguments = 2 * np.pi * frequencies
    asked = np.zeros(2)
    for k in range(round(DURATION / STEP)):
        if k % every == 0:
            rows.append(q.copy())
            time = k * STEP
            wanted = (sizes * np.sin(arguments * time + phases)).sum(axis=0)
            rate = (sizes * arguments * np.cos(arguments * time + phases)).sum(axis=0)
            asked = np.clip(12.0 * (wanted - q) + 0.5 * (rate - v), -6.0, 6.0)
        sign = np.tanh(v / SHARP)
        # the drive's torque, less what the gear loses of it
        plain = asked - truth["coulomb"] * sign - truth["viscous"] * v
        rest = plain / (1.0 + truth["load"] * sign * np.sign(plain))
        a = pin.aba(model, data, q, v, rest)
        torques.append(asked.copy())
        v = v + STEP * a
        q = q + STEP * v
    late = round(float(truth["age of torques"][0] + 0.5 * (PERIOD - STEP)) / STEP)
    used = np.array(torques)
    seen = np.concatenate([np.repeat(used[:1], late, axis=0), used])[: len(used)][::every]
    measured = seen / constant + truth["offset"] + TORQUE_NOISE * rng.normal(size=seen.shape)
    angles = np.array(rows) + ANGLE_NOISE * rng.normal(size=(len(rows), 2))
    return MotionLog(name, PERIOD, RESOLUTION * np.round(angles / RESOLUTION), measured)


def coverage(robots: int, seed: int = 0) -> dict[str, list[float]]:
    """Return, by unknown, the errors of the robots' fits in standard deviations."""
    errors: dict[str, list[float]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        robot = pendulum(Path(folder))
        for number in range(robots):
            rng = np.random.default_rng([seed, number])
            truth, pin_model = drawn(robot, rng)
            logs = [simulated_log(pin_model, truth, rng, f"{k}") for k in range(2)]
            model, fit = fit_dynamics(robot, logs)
            for kind, values in truth.items():
                names = fit.unknowns.names[model.part(kind)]
                for name, value, found in zip(
                    names, values, fit.estimates_at(model.part(kind)), strict=True
                ):
                    errors[name].append((found.value - float(value)) / found.std)
    return dict(errors)


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    errors = coverage(arguments.robots, arguments.seed)
    print(f"{'':<34} within 90 %   mean   rms error [standard deviations]")
    for name, each in errors.items():
        z = np.array(each)
        print(f"{name:<34} {np.mean(np.abs(z) < NINETY):11.3f} {z.mean():6.2f} {np.sqrt((z**2).mean()):6.2f}")  # fmt: skip
    every = np.concatenate([np.array(each) for each in errors.values()])
    print(f"{'all':<34} {np.mean(np.abs(every) < NINETY):11.3f}")


if __name__ == "__main__":
    main()
