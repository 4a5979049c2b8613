"""Walks of other robots, drawn by kinematics and logged: a table of docs/real_logs.md, made by ``real_logs.py``.

The trunk sways over feet that step; the legs follow by inverse kinematics, and the IMU and the encoders are computed with biases,
offsets and noise. No simulator has a part, so no controller and no contact model either. In ``YIELDING`` joints of the stance leg
yield by about a degree, which encoders do not see, or the sole itself rolls by a degree.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ... import load
from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.contact_kinematics import ContactKinematics, contact_motion, differentiate_contacts
from ...robots.description import RobotDescription, find_robot
from .icub_estimators import ESTIMATORS

ROBOTS = ("g1", "talos", "bruce")
YIELDING = ("nothing", "hips", "ankles", "soles")
RATES = (100, 500, 2000)
STARTS = (1.07, 1.33, 1.59, 1.85)
"""Times in the walk [s]: over two steps."""
SEEDS = (4, 5)
"""Of walks that nothing saw; on those of seeds 1 and 3 the estimator was changed, and seed 2 showed the cause."""
_GRID, _STEPS, _STEP_TIME, _DOUBLE = 500, 8, 0.6, 0.12
"""Samples a second, steps, and the times of a step and of its double support [s]."""
_ANGLE = math.radians(1.0)


def turn(roll: float, pitch: float, yaw: float) -> Array:
    """Return a rotation matrix, from body to world."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def quaternion(matrix: Array) -> Array:
    """Return the quaternion x, y, z, w of a small rotation."""
    w = math.sqrt(1.0 + np.trace(matrix)) / 2
    x, y, z = (
        (matrix[2, 1], matrix[1, 2]),
        (matrix[0, 2], matrix[2, 0]),
        (matrix[1, 0], matrix[0, 1]),
    )
    return np.array([*((a - b) / (4 * w) for a, b in (x, y, z)), w])


class Gait:
    """Where trunk and feet of a robot are at a time, and how far its stance leg yields."""

    def __init__(self, robot: RobotDescription, yielding: str, rng: np.random.Generator) -> None:
        self.robot, self.owners = robot, np.asarray(robot.foot_of_contact())
        self.kinematics = ContactKinematics(robot)
        self.joints = np.array(robot.standing_position, np.float64)
        self.left = next(k for k, foot in enumerate(robot.feet) if "left" in foot.name)
        places = self.points(np.eye(3), self.joints)
        self.height = -places[:, 2].min()
        self.scale = self.height / 0.6
        self.stance = places * [1.0, 1.0, 0.0]
        names = [joint.name for joint in robot.joints]
        legs = [
            k for k, n in enumerate(names) if any(s in n for s in ("hip", "knee", "ankle", "leg_"))
        ]
        self.leg_joints = np.array(legs)
        self.foot_of_joint = np.array(
            [self.left if "left" in names[k] else 1 - self.left for k in legs]
        )
        yields = [yielding != "nothing" and yielding[:-1] in _part(names[k]) for k in legs]
        self.amplitude = _ANGLE * np.array(yields) * rng.uniform(0.6, 1.4, len(legs))
        self.amplitude *= rng.choice([-1, 1], len(legs))
        self.mix = rng.uniform(0, 1, len(legs))
        self.rolling = _ANGLE * rng.choice([-1, 1]) if yielding == "soles" else 0.0
        self.phase = rng.uniform(-1, 1)

    def points(self, matrix: Array, joints: Array) -> Array:
        """Return the contact points [m, body], (n_contacts, 3)."""
        still, motion = np.zeros(len(joints)), self.kinematics.motion
        contact_motion(
            self.kinematics.bodies, self.kinematics.contacts, quaternion(matrix), np.zeros(3), joints,
            still, motion,
        )  # fmt: skip
        return motion.points.copy()

    def trunk(self, time: float) -> tuple[Array, Array]:
        """Return the base's place [m] and its rotation."""
        angle, scale = math.pi * time / _STEP_TIME, self.scale
        aside = 1 if self.left else -1
        place = [
            0.12 * scale * time / _STEP_TIME + 0.006 * scale * math.sin(2 * angle + 0.3),
            aside * 0.045 * scale * math.sin(angle + 0.2),
            self.height + scale * (0.006 * math.cos(2 * angle) - 0.02),
        ]
        pitch = 0.03 + 0.015 * math.sin(2 * angle + self.phase)
        return np.array(place), turn(
            0.02 * math.sin(angle + 0.5), pitch, 0.02 * math.sin(angle + self.phase)
        )

    def feet(self, time: float) -> tuple[Array, Array, Array]:
        """Return the contact points in the world, the feet that stand, and the joints' yielding [rad]."""
        points, standing = self.stance.copy(), np.ones(2, bool)
        yielding = np.zeros(len(self.joints))
        step = math.floor((time - _DOUBLE / 2) / _STEP_TIME)
        share = (time - _DOUBLE / 2 - step * _STEP_TIME) / (_STEP_TIME - _DOUBLE)
        share = min(max(share, 0.0), 1.0)
        for foot in (0, 1):
            own = self.owners == foot
            for swing in range(foot, _STEPS + 1, 2):
                done = (time - swing * _STEP_TIME - _DOUBLE / 2) / (_STEP_TIME - _DOUBLE)
                length = 0.12 * self.scale * (2 if swing else 1)
                x = min(max(done, 0.0), 1.0)
                points[own, 0] += length * x**3 * (10 - 15 * x + 6 * x * x)
                if 0 < done < 1:
                    points[own, 2] += 0.03 * self.scale * math.sin(math.pi * done) ** 2
                    standing[foot] = False
            if step % 2 == foot:  # it swings, or has just come down
                continue
            load, change = math.sin(math.pi * share) ** 2, 1.5 * math.cos(math.pi * share)
            middle = points[own].mean(axis=0)
            roll = turn(0.5 * self.rolling * load * change, self.rolling * load * change, 0.0)
            points[own] = (points[own] - middle) @ roll.T + middle
            here = self.foot_of_joint == foot
            shape = load * (self.mix * change + 1 - self.mix)
            yielding[self.leg_joints[here]] = (self.amplitude * shape)[here]
        return points, standing, yielding

    def follow(self, place: Array, matrix: Array, points: Array) -> None:
        """Move the legs until their contact points are where they should be."""
        n, legs = len(self.joints), self.leg_joints
        centres, jacobian = np.empty((len(points), 3)), np.empty((len(points), 3, n))
        for _ in range(12):
            error = ((points - place) @ matrix - self.points(matrix, self.joints)).ravel()
            if np.abs(error).max() < 1e-7:
                return
            differentiate_contacts(
                self.kinematics.bodies, self.kinematics.contacts, centres, jacobian
            )
            rows = np.vstack([jacobian.reshape(-1, n)[:, legs], 1e-4 * np.eye(len(legs))])
            wanted = np.concatenate([error, np.zeros(len(legs))])
            self.joints[legs] += np.clip(np.linalg.lstsq(rows, wanted, rcond=None)[0], -0.2, 0.2)


def _part(name: str) -> str:
    """Return of which part of a leg a joint is; Talos counts its joints from the hip."""
    if "leg_" in name:
        return ("hip", "hip", "hip", "knee", "ankle", "ankle")[int(name.split("_")[2]) - 1]
    return next((part for part in ("hip", "knee", "ankle") if part in name), "")


def write_walk(file: Path, name: str, yielding: str, seed: int, steps: int = _STEPS) -> None:
    """Write the log of a walk: an NPZ file."""
    rng = np.random.default_rng(seed)
    robot = find_robot(name)
    gait = Gait(robot, yielding, rng)
    count, period = round(steps * _STEP_TIME * _GRID), 1.0 / _GRID
    time = period * np.arange(count)
    places, turns = np.empty((count, 3)), np.empty((count, 3, 3))
    joints, standing = np.empty((count, len(gait.joints))), np.empty((count, 2), bool)
    for k in range(count):
        places[k], turns[k] = gait.trunk(time[k])
        points, standing[k], yielded = gait.feet(time[k])
        gait.follow(places[k], turns[k], points)
        joints[k] = gait.joints - yielded
    change = np.einsum("nji,njk->nik", turns[:-1], turns[1:])
    rate = np.stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]], axis=1) / period
    rate = np.vstack([rate[:1], rate])
    force = np.gradient(np.gradient(places, period, axis=0), period, axis=0)
    force[:, 2] += GRAVITY
    force = np.einsum("nji,nj->ni", turns, force)

    def measured(values: Array, offset: float, noise: float) -> Array:
        width = values.shape[1]
        return values + rng.normal(0, offset, width) + rng.normal(0, noise, (count, width))

    columns: dict[str, Any] = {
        "time": time,
        "gyro": measured(rate, 0.006, 0.01),
        "accelerometer": measured(force, 0.06, 0.08),
        "angle": measured(joints, 0.0017, 2e-4),
        "speed": measured(np.asarray(np.gradient(joints, period, axis=0)), 0.0, 0.02),
        "place": places,
        "turn": np.array([quaternion(each) for each in turns]),
        **{f"foot_{foot}": 100.0 * standing[:, foot] for foot in (0, 1)},
    }
    np.savez(file, **columns)


def graph_of(file: Path, name: str, rate: int, estimator: str) -> dict[str, Any]:
    """Return the graph in which an estimator follows a walk."""
    feet = {foot.name: {"force": f"foot_{k}"} for k, foot in enumerate(find_robot(name).feet)}
    log = {
        "file": str(file),
        "clock": {"stamps": "time", "even": True},
        "joints": {"position": "angle", "velocity": "speed"},
        "imu": {"angular_velocity": "gyro", "specific_force": "accelerometer"},
        "contacts": feet,
        "truth": {"position": "place", "quaternion": "turn"},
    }
    sensed = {"imu": "robot.imu", "joints": "robot.joints"}
    contacts = {"active": "robot.contacts.closed"}
    score = {"truth": "robot.truth", "base": "estimator.base"}
    return {
        "rate": f"{rate} Hz",
        "robot": name,
        "blocks": {
            "robot": {"use": "hal.LogRobot", "with": log},
            "estimator": {"use": f"blocks.{estimator}", "in": {**sensed, "contacts": contacts}},
            "score": {"use": "blocks.EstimatorScore", "with": {"align": "start"}, "in": score},
        },
    }


def errors_of(
    file: Path, name: str, rate: int, estimator: str, settings: dict[str, Any] | None = None
) -> Array:
    """Return the errors of position [mm] from each start."""
    graph = load(graph_of(file, name, rate, estimator))
    found = []
    for begin in STARTS:
        run = graph.changed({"robot.begin": begin, **(settings or {})}).run(
            log=False, run_hash=False
        )
        found.append(1e3 * float(run.metrics["estimator_position_rms_m"]))
    return np.array(found)


def rows() -> Iterator[str]:
    """Give the lines of the table: geometric means over the starts, one for each rate."""
    variants: list[tuple[str, str, dict[str, Any]]] = [
        (f"`{name}`", name, {}) for name in ESTIMATORS
    ]
    variants.insert(1, ("the same, `flexion: 0`", ESTIMATORS[0], {"estimator.flexion": 0.0}))
    yield f"| robot | what yields | {' | '.join(text for text, _, _ in variants)} |"
    yield "|---|---|" + "---|" * len(variants)
    with tempfile.TemporaryDirectory() as folder:
        for name in ROBOTS:
            for yielding in YIELDING:
                files = [Path(folder) / f"{name}_{yielding}_{seed}.npz" for seed in SEEDS]
                for file, seed in zip(files, SEEDS, strict=True):
                    write_walk(file, name, yielding, seed)
                cells = []
                for _, estimator, settings in variants:
                    means = []
                    for rate in RATES:
                        errors = [
                            errors_of(file, name, rate, estimator, settings) for file in files
                        ]
                        means.append(math.exp(np.log(errors).mean()))
                    cells.append(" / ".join(f"{mean:.1f}" for mean in means))
                yield f"| {name} | {yielding} | {' | '.join(cells)} |"
