"""Trains a linear policy on a graph by trying gains at random, and prints what it reached."""

import numpy as np

import aloft.environments

environment = aloft.environments.make(
    "push.yaml",
    action="force",
    observation=["place.y.value", "speed.y.value"],
    reward=lambda run: -abs(float(run["place.y.value"][0])),
    action_limits=(-5.0, 5.0),
    ticks=5,
)


def total(gains: np.ndarray) -> float:
    """Return the sum of rewards of an episode with the action -gains @ observation."""
    observation, _ = environment.reset(seed=0)
    reward, ended = 0.0, False
    while not ended:
        action = np.clip(-gains @ observation, -5.0, 5.0)
        observation, more, terminated, truncated, _ = environment.step([float(action)])
        reward += more
        ended = terminated or truncated
    return reward if not terminated else -1000.0


random = np.random.default_rng(1)
best, most = np.zeros(2), -1000.0
for _ in range(60):
    tried = best + random.normal(0.0, 2.0, 2)
    if (reached := total(tried)) > most:
        best, most = tried, reached
environment.close()
print(f"gains {best.round(1)}, reward {most:.1f}")
