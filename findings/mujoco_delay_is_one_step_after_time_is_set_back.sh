#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): setting `data.time` back to zero between two episodes, with joints set anew by hand, shrinks
# every delay to one step until time has passed the stamps of the earlier episode: the samples of the buffer are sorted by
# time, and those of the future stay the newest. mj_resetData empties the buffers and keeps the delay.
# Seen: after an episode of 1 s a sensor with a delay of 5 steps is 1 step old for the whole first second of the next.
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
model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="{STEP}"/>
  <worldbody><body><joint type="slide"/><geom size=".1"/></body></worldbody>
  <sensor><clock name="stamp" nsample="5" delay="{5 * STEP!r}"/></sensor></mujoco>""")


def second_episode(restart):
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    restart(data)
    ages = []
    for _ in range(900):
        now = data.time
        mujoco.mj_step(model, data)
        ages.append(round((now - data.sensordata[0]) / STEP))
    return Counter(ages[10:480]), Counter(ages[520:])


def by_hand(data):
    data.time, data.qpos[:], data.qvel[:] = 0.0, 0.0, 0.0


hand, reset = second_episode(by_hand), second_episode(lambda data: mujoco.mj_resetData(model, data))
print(f"mujoco {mujoco.mj_versionString()}: age in steps of a sensor delayed by 5, in the first second and after it: "
      f"time set by hand {dict(hand[0])}, {dict(hand[1])}; mj_resetData {dict(reset[0])}, {dict(reset[1])}")
sys.exit(0 if set(hand[0]) == {1} and set(hand[1]) == {5} and set(reset[0]) == set(reset[1]) == {5} else 1)
CODE
