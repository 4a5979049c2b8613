"""Estimators on two logs of a real iCub: a table and a picture of docs/real_logs.md, made by ``real_logs.py``."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ... import load
from ...mathematics.arrays import Array
from ...plotting import Curve, Panel, save_panels
from ...robots.description import find_robot
from . import DATA

ESTIMATORS = ("StateEstimator", "InvariantKalmanFilter", "ComplementaryFilter")
RATES = (100, 250, 500, 1000, 2000)
LOGS = (
    ("walk", "walking.mat", 0.0),
    ("walk, from 6.1 s", "walking.mat", 6.1),
    ("walk, from 6.9 s", "walking.mat", 6.9),
    ("walk, from 7.6 s", "walking.mat", 7.6),
    ("walk, from 8.0 s", "walking.mat", 8.0),
    ("sway", "com-sinusoid.mat", 0.0),
)
STARTS = [round(5.53 + 0.15 * k + 0.05 * (k % 2), 2) for k in range(31)]
"""Times in the walk [s], from its first step to two seconds before its end. Nothing was tuned on them: what was is the starts
from 5.50 and 5.55 s, every 0.15 s."""
KEPT = {"estimator.keep_soles": True}
JOINTS = [
    "neck_pitch",
    "neck_roll",
    "neck_yaw",
    "torso_pitch",
    "torso_roll",
    "torso_yaw",
    "l_shoulder_pitch",
    "l_shoulder_roll",
    "l_shoulder_yaw",
    "l_elbow",
    "r_shoulder_pitch",
    "r_shoulder_roll",
    "r_shoulder_yaw",
    "r_elbow",
    "l_hip_pitch",
    "l_hip_roll",
    "l_hip_yaw",
    "l_knee",
    "l_ankle_pitch",
    "l_ankle_roll",
    "r_hip_pitch",
    "r_hip_roll",
    "r_hip_yaw",
    "r_knee",
    "r_ankle_pitch",
    "r_ankle_roll",
]
"""The order of the logs' columns."""
SOLE = "[[0.12, 0.04, 0], [0.12, -0.04, 0], [-0.06, 0.04, 0], [-0.06, -0.04, 0]]"
ICUB = """
file: {model}
name: icub
text: iCubGenova04, of its URDF
base_joint: floating
feet:
  - {{name: r_sole, at: r_sole, points: {sole}}}
  - {{name: l_sole, at: l_sole, points: {sole}}}
profiles:
  rated: {{friction: 0, damping: 0}}
sensors:
  imu: true
  switches: true
  root_link_imu_acc:
    kind: imu
    link: base_link
    position: [0.085155, -0.011, -0.112309]
    orientation: [0.612372, -0.612372, 0.353553, -0.353553]
"""


def write_robot(folder: Path) -> Path:
    """Write the iCub's description into a folder."""
    file = folder / "icub.yaml"
    text = ICUB.format(model=DATA / "icub" / "model.urdf", sole=SOLE)
    file.write_text(text)
    standing = find_robot(str(file)).standing  # it need not be looked for in each run
    file.write_text(f"{text}standing: {json.dumps(standing)}\n")
    return file


def graph_of(robot: Path, log: str, rate: int, estimator: str, begin: float) -> dict[str, Any]:
    """Return the graph in which an estimator follows a log."""
    force = {"closes": "150 N", "opens": "120 N"}
    return {
        "rate": f"{rate} Hz",
        "robot": str(robot),
        "blocks": {
            "robot": {
                "use": "hal.LogRobot",
                "with": {
                    "file": str(DATA / "icub" / log),
                    "clock": {"stamps": "estimatorJointsTime", "even": True},
                    "begin": begin,
                    "joints": {
                        "names": JOINTS,
                        "position": "estimatorJointsPos",
                        "velocity": "estimatorJointsVel",
                    },
                    "imu": {
                        "angular_velocity": "imuOmega",
                        "specific_force": "imuAcc",
                        "sensor": "root_link_imu_acc",
                    },
                    "contacts": {
                        "l_sole": {"force": "lfForceZ", **force},
                        "r_sole": {"force": "rfForceZ", **force},
                    },
                    "truth": {"position": "linkBasePos", "rpy": "linkBaseRot"},
                },
            },
            "estimator": {
                "use": f"blocks.{estimator}",
                "in": {
                    "imu": "robot.imu",
                    "joints": "robot.joints",
                    "contacts": {"active": "robot.contacts.closed"},
                },
            },
            "score": {
                "use": "blocks.EstimatorScore",
                "with": {"align": "start"},
                "in": {"truth": "robot.truth", "base": "estimator.base"},
            },
        },
    }


def metrics_of(
    robot: Path,
    log: str,
    rate: int,
    estimator: str,
    begin: float = 0.0,
    settings: dict[str, Any] | None = None,
) -> Any:
    """Return the metrics of an estimator on a log."""
    graph = load(graph_of(robot, log, rate, estimator, begin)).changed(settings or {})
    return graph.run(log=False, run_hash=False).metrics


def rows() -> Iterator[str]:
    """Give the lines of the table: position errors, and the tilt at 500 Hz."""
    yield (
        "| log | estimator | "
        + " | ".join(f"{rate} Hz" for rate in RATES)
        + " | tilt [deg] | end [mm] |"
    )
    yield "|---|---|" + "---|" * (len(RATES) + 2)
    with tempfile.TemporaryDirectory() as folder:
        robot = write_robot(Path(folder))
        for name, log, begin in LOGS:
            variants: list[tuple[str, str, dict[str, Any]]] = [
                (f"`{each}`", each, {}) for each in ESTIMATORS
            ]
            if not begin:
                variants.insert(1, ("the same, `keep_soles: true`", ESTIMATORS[0], KEPT))
            for text, estimator, settings in variants:
                found = {
                    rate: metrics_of(robot, log, rate, estimator, begin, settings) for rate in RATES
                }
                errors = [f"{1e3 * found[rate]['estimator_position_rms_m']:.1f}" for rate in RATES]
                tilt = 57.29578 * found[500]["estimator_tilt_rms_rad"]
                end = 1e3 * found[500]["estimator_position_end_m"]
                yield f"| {name} | {text} | {' | '.join(errors)} | {tilt:.2f} | {end:.0f} |"


def start_rows() -> Iterator[str]:
    """Give the lines of the table of all starts: how far the default is behind the best of the three."""
    yield (
        "| rate | within 1.2 times the best | default, geometric mean [mm] | times the best | "
        "worst start | default there [mm] | best there [mm] |"
    )
    yield "|---|---|---|---|---|---|---|"
    with tempfile.TemporaryDirectory() as folder:
        robot = write_robot(Path(folder))
        for rate in RATES:
            graphs = [load(graph_of(robot, "walking.mat", rate, each, 0.0)) for each in ESTIMATORS]
            errors = np.empty((len(STARTS), len(graphs)))
            for row, begin in zip(errors, STARTS, strict=True):
                change = {"robot.begin": begin}
                runs = [each.changed(change).run(log=False, run_hash=False) for each in graphs]
                row[:] = [1e3 * float(run.metrics["estimator_position_rms_m"]) for run in runs]
            best = errors.min(axis=1)
            ratios = errors[:, 0] / best
            worst = int(np.argmax(ratios))
            default, ratio = np.exp(np.mean(np.log([errors[:, 0], ratios]), axis=1))
            yield (
                f"| {rate} Hz | {(ratios <= 1.2).sum()} of {len(STARTS)} | {default:.1f} | {ratio:.2f} | "
                f"{STARTS[worst]:.2f} s, {ratios[worst]:.2f} | {errors[worst, 0]:.1f} | {best[worst]:.1f} |"
            )


def draw(path: Path) -> None:
    """Draw where the walk is by each estimator, beside the cameras."""
    panels = []
    with tempfile.TemporaryDirectory() as folder:
        robot = write_robot(Path(folder))
        for axis, title in ((0, "forward [m]"), (1, "to the left [m]")):
            lines: list[Curve] = []
            for estimator in ESTIMATORS:
                result = load(graph_of(robot, "walking.mat", 500, estimator, 0.0)).run()
                place = result.signal("estimator.base.position")
                truth = aligned(result, place)
                time = np.arange(len(place), dtype=np.float64) * result.period
                if not lines:
                    lines.append(Curve("cameras", time, truth[:, axis], colour="#888888"))
                lines.append(Curve(estimator, time, place[:, axis]))
            panels.append(Panel(title, lines))
    save_panels(panels, "An iCub's walk: where it is by each estimator, at 500 Hz", path)


def aligned(result: Any, place: Array) -> Array:
    """Return the cameras' positions in the estimator's world, by yaw and place at the first sample."""
    truth, turn = (
        result.signal("robot.truth.base_position"),
        result.signal("robot.truth.base_orientation"),
    )
    own = result.signal("estimator.base.orientation")
    angle = _yaw(own[0]) - _yaw(turn[0])
    c, s = np.cos(angle), np.sin(angle)
    moved: Array = (
        place[0] + (truth - truth[0]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    )
    return moved


def _yaw(four: Any) -> float:
    x, y, z, w = four
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
