"""The dynamics of a real double pendulum, identified on slow logs and judged on a swing-up: a table of docs/real_logs.md.

Design C.1 of the double pendulum in ``shared/data``: four slow runs, a swing-up, and parameters that its makers published.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...extensions.commissioning.identification.band import torque_at
from ...extensions.commissioning.identification.dynamics_report import (
    IdentifiedDynamics,
    identify_dynamics,
    residual_of,
)
from ...extensions.commissioning.identification.motion_log import MotionLog, log_of_graph
from ...mathematics.arrays import Array
from ...robots.robot_description import RobotDescription
from . import DATA

SLOW, HELD_OUT = ("143339", "143524", "143601", "143704"), "154220"
PUBLISHED = {
    "Link2 m z": -0.159953, "Link2 Ixx": 0.0508698, "Link1 m z - 0.2 Link2 mass": -0.229806,
    "Link1 Ixx + 0.04 Link2 mass": 0.0569099, "rotor inertia of Joint2": 0.0022634,
    "coulomb of Joint1": 0.16, "coulomb of Joint2": 0.12, "viscous of Joint1": 0.001, "viscous of Joint2": 0.001,
}  # fmt: skip
"""Of ``identified_model_1.0.yml``: the file's inertias are about the joints."""
YAML = """file: pendubot.urdf
name: pendubot
text: design C.1 of the double pendulum
base_joint: fixed
profiles: {rated: {damping: 0.001, rotor_inertia: 0.0022634, motors: {Joint1: {friction: 0.16}, Joint2: {friction: 0.12}}}}
sensors: {imu: false, switches: false}
"""
GRAPH = """rate: 500 Hz
robot: pendubot.yaml
blocks:
  robot:
    use: hal.LogRobot
    with:
      file: FILE
      clock: {stamps: time}
      joints:
        names: [Joint1, Joint2]
        position: [pos_meas1, pos_meas2]
        torque: [tau_meas1, tau_meas2]
        commanded: [tau_con1, tau_con2]
"""


def write_graphs(folder: Path) -> dict[str, Path]:
    """Write the robot and a graph for each log into a folder, and return the graphs by log."""
    data = DATA / "double_pendulum"
    (folder / "pendubot.urdf").write_text((data / "pendubot.urdf").read_text())
    (folder / "pendubot.yaml").write_text(YAML)
    files = {}
    for name in (*SLOW, HELD_OUT):
        files[name] = folder / f"{name}.yaml"
        files[name].write_text(GRAPH.replace("FILE", str(data / f"sysid_{name}.csv")))
    return files


def logs() -> tuple[list[MotionLog], MotionLog, RobotDescription]:
    """Return the slow logs, the swing-up and the robot."""
    with tempfile.TemporaryDirectory() as folder:
        files = write_graphs(Path(folder))
        read = {name: log_of_graph(file) for name, file in files.items()}
    return [read[name][0] for name in SLOW], read[HELD_OUT][0], read[HELD_OUT][1]


def published(found: IdentifiedDynamics) -> Array:
    """Return the vector of unknowns that the published parameters are."""
    value = np.zeros(len(found.fit.value))
    for name, each in PUBLISHED.items():
        value[found.fit.unknowns.names.index(name)] = each
    return value


def identified() -> IdentifiedDynamics:
    """Fit the slow logs and judge by the swing-up."""
    slow, swing_up, robot = logs()
    return identify_dynamics(robot, slow, [swing_up])


def rows(found: IdentifiedDynamics) -> Iterator[str]:
    """Give the lines of both tables."""
    names = found.fit.unknowns.names
    std = np.sqrt(np.diag(found.fit.covariance))
    yield "| value | found | +- | published |"
    yield "|---|---|---|---|"
    for name, known in PUBLISHED.items():
        k = names.index(name)
        yield f"| {name} | {found.body.value[k]:.4f} | {std[k]:.4f} | {known:.4f} |"
    yield ""
    yield "| log | torque, rms [N m] | not explained by the fit | by the published parameters |"
    yield "|---|---|---|---|"
    slow, swing_up, _ = logs()
    theirs = published(found)
    for log, each in zip((*slow, swing_up), found.residuals, strict=True):
        other = residual_of(found.model, theirs, log, each.held_out)
        cells = [
            " / ".join(f"{value:.3f}" for value in part.values())
            for part in (each.torque, each.fitted, other.fitted)
        ]
        name = f"`{log.name}`" + (", held out" if each.held_out else "")
        yield f"| {name} | {' | '.join(cells)} |"


def held_out_curves(found: IdentifiedDynamics) -> tuple[Array, Array, Array]:
    """Return times (m,), measured and predicted torques (m, 2) of the swing-up below 10 Hz."""
    _, swing_up, _ = logs()
    formed = found.model.form(swing_up, 10.0)
    made = [found.model.predicted(found.body.value, formed, half)[0] for half in (0, 1)]
    step = swing_up.duration / (len(torque_at(swing_up, 10.0)) - 1)
    return formed.low.centres.astype(np.float64) * step, formed.torque, 0.5 * (made[0] + made[1])
