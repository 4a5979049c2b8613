#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): a sensor delayed by a whole number of steps is not delayed by that number. Where the buffer is
# longer than the delay (`nsample` for the longest delay, `delay` below it, as for delays that are changed later) the reading
# is k steps old in some ticks and k + 1 in others: the stamps are sums of the time step, so "time - delay" falls a rounding
# error before the sample that is meant, and a held reading takes the one before it. With `nsample` equal to k the same delay
# is k in every tick. A delay of k - 0.5 steps is k in every tick, too.
# Seen: of 20,000 ticks at 2 ms, a delay of 10 ms is 5 steps in 12,000 and 6 in 8,000.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" mujoco-core==4.0.1 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys
from collections import Counter

import mujoco

STEP = 0.002


def ages(samples, delay):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{STEP}"/>
      <worldbody><body><joint type="slide"/><geom size=".1"/></body></worldbody>
      <sensor><clock name="stamp" nsample="{samples}" delay="{delay!r}"/></sensor></mujoco>""")
    data = mujoco.MjData(model)
    counted = Counter()
    for tick in range(20_000):
        now = data.time
        mujoco.mj_step(model, data)
        if tick > 50:
            counted[round((now - data.sensordata[0]) / STEP)] += 1
    return dict(sorted(counted.items()))


exact, longer, half = ages(5, 5 * STEP), ages(20, 5 * STEP), ages(20, 4.5 * STEP)
print(f"mujoco {mujoco.mj_versionString()}: 5 steps of delay, ages in steps with nsample 5: {exact}, nsample 20: {longer}; "
      f"4.5 steps of delay with nsample 20: {half}")
sys.exit(0 if set(exact) == {5} and set(longer) == {5, 6} and set(half) == {5} else 1)
CODE
