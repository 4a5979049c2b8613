#!/bin/sh
# simple-pid 2.0.1: a call with the step, `pid(measured, dt=0.002)`, compares that step with `sample_time`, which is 0.01 s unless it is set, and gives the last output again where it is shorter.
# Expected: a controller that is told its step takes it, as in a simulation or a fixed tick. Seen: at 500 Hz every call after the first gives the first output, however the measurement moves:
# the steps are not added up, so 10 ms never pass. At 100 Hz and below it works, so a loop that is made faster loses its controller without a word. `sample_time=None` avoids it.
# Seen: P alone, setpoint 1, measurements 0, 0.2, ... 0.8: outputs 1, 1, 1, 1, 1 at 2 ms, in place of 1, 0.8, ... 0.2; a mass is pushed with the first force for ever.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check simple-pid==2.0.1
"$folder/env/bin/python" - <<'CODE'
import sys

from simple_pid import PID

MEASURED = (0.0, 0.2, 0.4, 0.6, 0.8)


def outputs(step, **settings):
    pid = PID(1.0, 0.0, 0.0, setpoint=1.0, **settings)
    return [round(pid(value, dt=step), 6) for value in MEASURED]


def position(step, **settings):
    """Where a mass of 1 kg is after 20 s that a PD controller should hold at 1 m."""
    pid = PID(4.0, 0.0, 4.0, setpoint=1.0, **settings)
    place = speed = 0.0
    for _ in range(round(20.0 / step)):
        speed += step * pid(place, dt=step)
        place += step * speed
    return place


right = [1.0, 0.8, 0.6, 0.4, 0.2]
found = {"2 ms": outputs(0.002), "10 ms": outputs(0.01), "2 ms, sample_time=None": outputs(0.002, sample_time=None)}
for name, row in found.items():
    print(f"simple-pid 2.0.1, steps of {name}: {row}")
held, lost = position(0.002, sample_time=None), position(0.002)
print(f"a mass that is to be held at 1 m is after 20 s at {held:.3f} m with sample_time=None, at {lost:.0f} m without")
sys.exit(0 if found == {"2 ms": [1.0] * 5, "10 ms": right, "2 ms, sample_time=None": right} and abs(held - 1) < 1e-3 and lost > 100 else 1)
CODE
