#!/bin/sh
# Ruckig 0.19.4: `position_extrema` of a trajectory miss the turning point where it overshoots: the extreme and its time are
# those of an end of one of the seven phases, not of the zero of the velocity within it. `at_time` of the same trajectory goes
# further. Who checks a joint's range by `position_extrema` lets it pass.
# Seen: start at 1 m/s, target 0.1 m, 1 m/s^2, 10 m/s^3: extreme 0.386 m at 1.62 s, at_time reaches 0.550 m at 1.05 s; of 300 random
# starts and targets half are off by more than 1 mm. Starts at rest are right.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "ruckig==0.19.4"
"$folder/venv/bin/python" - <<'CODE'
import random
import sys

from ruckig import InputParameter, Ruckig, Trajectory


def extremes(position, velocity, target):
    """Return the least and largest position as told, and as sampled."""
    wanted = InputParameter(1)
    wanted.current_position, wanted.current_velocity, wanted.current_acceleration = [position], [velocity], [0.0]
    wanted.target_position, wanted.target_velocity, wanted.target_acceleration = [target], [0.0], [0.0]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [2.0], [1.0], [10.0]
    path = Trajectory(1)
    Ruckig(1).calculate(wanted, path)
    told = path.position_extrema[0]
    places = [path.at_time(path.duration * part / 4000)[0][0] for part in range(4001)]
    return (told.min, told.max), (min(places), max(places))


def off(position, velocity, target):
    told, sampled = extremes(position, velocity, target)
    return max(abs(a - b) for a, b in zip(told, sampled))


told, sampled = extremes(0.0, 1.0, 0.1)
drawn = random.Random(1)
moving = sum(off(drawn.uniform(-1, 1), drawn.uniform(-1, 1), drawn.uniform(-1, 1)) > 1e-3 for _ in range(300))
resting = sum(off(drawn.uniform(-1, 1), 0.0, drawn.uniform(-1, 1)) > 1e-3 for _ in range(300))
print(f"ruckig 0.19.4: told {told[1]:.3f} m, at_time {sampled[1]:.3f} m; off by over 1 mm: {moving} of 300 moving starts, {resting} of 300 at rest")
sys.exit(0 if sampled[1] - told[1] > 0.1 and moving > 100 and resting == 0 else 1)
CODE
