#!/bin/sh
# Ruckig 0.19.4 (the open package): `max_position` and `min_position` of the input are taken and not used. A start whose
# braking way leads past the limit is planned through it, a target beyond it is driven to, `validate_input` is true and the
# result is "Working" or "Finished", though the module has an ErrorPositionalLimits. Who guards a joint's end stop with these
# fields guards nothing: sample the trajectory and check it.
# Seen: limit 0.2 m, start at 1 m/s: the trajectory reaches 0.55 m, as without the limit; a target of 0.1 m with limit 0.05 m is reached.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "ruckig==0.19.4"
"$folder/venv/bin/python" - <<'CODE'
import sys

from ruckig import InputParameter, Ruckig, Trajectory


def planned(velocity, target, limit):
    wanted = InputParameter(1)
    wanted.current_position, wanted.current_velocity, wanted.current_acceleration = [0.0], [velocity], [0.0]
    wanted.target_position, wanted.target_velocity, wanted.target_acceleration = [target], [0.0], [0.0]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [2.0], [1.0], [10.0]
    if limit is not None:
        wanted.max_position, wanted.min_position = [limit], [-limit]
    planner, path = Ruckig(1), Trajectory(1)
    valid, result = planner.validate_input(wanted), planner.calculate(wanted, path)
    farthest = max(path.at_time(path.duration * part / 1000)[0][0] for part in range(1001))
    return valid, result.name, round(farthest, 3)


rows = {
    "start at 1 m/s, no limit": planned(1.0, 0.1, None),
    "start at 1 m/s, limit 0.2 m": planned(1.0, 0.1, 0.2),
    "target 0.1 m, limit 0.05 m": planned(0.0, 0.1, 0.05),
}
for name, (valid, result, farthest) in rows.items():
    print(f"ruckig 0.19.4: {name}: valid {valid}, {result}, farthest {farthest} m")
free, passed, beyond = rows.values()
sys.exit(0 if free == passed and passed[2] > 0.5 and beyond[0] and beyond[2] == 0.1 else 1)
CODE
