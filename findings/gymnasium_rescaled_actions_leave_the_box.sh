#!/bin/sh
# gymnasium 1.4.0: `RescaleAction` maps the ends of its own action space to actions that the wrapped environment's `Box` does not
# contain: the sum of slope and intercept rounds, and nothing clips it. An environment that checks `action_space.contains` refuses a
# policy that saturates, for some limits and not for others, and so after hours of training.
# Seen: of 400 ends of 200 boxes with limits of two decimals 77 are outside, by up to 9e-16. `ClipAction` inside of it
# is no help: its own action space is unbounded, which RescaleAction refuses; a `TransformAction` that clips is.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" gymnasium==1.4.0 numpy==2.4.6
PYTHONPATH="$folder" python3 -W ignore - <<'CODE'
import sys

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.wrappers import RescaleAction, TransformAction


class Plant(gymnasium.Env):
    observation_space = Box(-1.0, 1.0, (1,))

    def __init__(self, low, high):
        self.action_space = Box(np.array([low]), np.array([high]), dtype=np.float64)

    def reset(self, **_):
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.inside = self.action_space.contains(np.asarray(action, np.float64))
        return np.zeros(1, np.float32), 0.0, False, False, {}


random = np.random.default_rng(0)
ends = outside = clipped = 0
for _ in range(200):
    low, high = np.sort(random.uniform(-5, 5, 2).round(2))
    plant = Plant(low, high)
    for plain in (True, False):
        safe = TransformAction(plant, lambda action, a=low, b=high: np.clip(action, a, b), plant.action_space)
        scaled = RescaleAction(plant if plain else safe, -1.0, 1.0)
        scaled.reset()
        for end in (scaled.action_space.low, scaled.action_space.high):
            scaled.step(end)
            if plain:
                ends, outside = ends + 1, outside + (not plant.inside)
            else:
                clipped += not plant.inside
print(f"gymnasium 1.4.0: RescaleAction's own ends are outside of the environment's Box in {outside} of {ends} cases, clipped in {clipped}")
sys.exit(0 if outside > 20 and not clipped else 1)
CODE
