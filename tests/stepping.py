"""A log of a robot that stands on one foot, then on the other, by kinematics alone: what is true of its columns is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aloft.hal.log.standing_feet import LoggedMotion
from aloft.robots.description import find_robot
from aloft.robots.kinematics import link_poses

BRUCE = find_robot("bruce")
NAMES = [joint.name for joint in BRUCE.joints]
PERIOD = 0.005


def stepping(seed: int = 0, seconds: float = 8.0, speed: float = 1.0) -> LoggedMotion:
    """A robot that stands on one foot, then on the other, and bends both legs; the kinematics are those of the project's."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, PERIOD)
    phases = rng.uniform(0.0, 6.0, (3, len(NAMES)))
    waves = [
        np.sin(speed * rate * time[:, None] + phase)
        for rate, phase in zip((2.0, 3.1, 4.7), phases, strict=True)
    ]
    angles = BRUCE.standing_position + 0.08 * sum(waves)
    standing = (time[:, None] % 4.0 < 2.0) == [True, False]
    level = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    poses = link_poses(BRUCE, np.zeros((len(time), 3)), level, angles)
    stand = link_poses(BRUCE, np.zeros((1, 3)), level[:1], BRUCE.standing_position[None])
    up, rate = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    for k, foot in enumerate(BRUCE.feet):
        own = standing[:, k]
        turn = poses.of(foot.link)[1]
        level_turn = turn @ stand.of(foot.link)[1][0].T
        spin = np.gradient(level_turn, PERIOD, axis=0) @ np.swapaxes(level_turn, 1, 2)
        up[own] = level_turn[own, :, 2]
        rate[own] = -np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)[own]
    return LoggedMotion(angles, np.gradient(angles, PERIOD, axis=0), standing, rate, up)


def shuffled(motion: LoggedMotion, order: np.ndarray) -> LoggedMotion:
    return replace(motion, position=motion.position[:, order], velocity=motion.velocity[:, order])
