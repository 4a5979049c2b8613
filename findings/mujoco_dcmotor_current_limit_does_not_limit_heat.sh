#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): `saturation` of a `dcmotor` limits the torque, not the current. A limit of 3 A (or of the torque
# of 3 A) leaves the current at voltage / resistance, and the winding heats with that: the thermal model of a limited motor is
# that of one without a limit. Real drives limit the current, so this motor gets hot where the real one stays cold.
# Seen: 10 V on 1 Ohm, stalled 5 s: 3 A or no limit, both 36.26 K warmer and 10 A less what the warmer copper takes; 3 V give
# the same torque as the limit and 3.5 K.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" mujoco-core==4.0.1 numpy==2.4.6
PYTHONPATH="$folder" python3 - <<'CODE'
import sys

import mujoco


def stalled(volts, limit):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="0.001" gravity="0 0 0"/>
      <worldbody><body><joint name="shaft"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
      <actuator><dcmotor joint="shaft" resistance="1" motorconst="0.1 0.1" inductance="0.001 0"
        thermal="1 10 0 0.004 25 25" saturation="0 {limit} 0"/></actuator></mujoco>""")
    data = mujoco.MjData(model)
    for _ in range(5000):
        data.ctrl[0], data.qvel[0] = volts, 0.0
        mujoco.mj_step(model, data)
    warmer, current = data.act
    return round(float(data.actuator_force[0]), 3), round(float(current), 2), round(float(warmer), 2)


limited, free, weak = stalled(10, 3), stalled(10, 0), stalled(3, 0)
for name, row in (("10 V, limit 3 A", limited), ("10 V, no limit", free), ("3 V, no limit", weak)):
    print(f"mujoco {mujoco.mj_versionString()}: {name}: {row[0]} N m, {row[1]} A, {row[2]} K above ambient")
sys.exit(0 if limited[0] == 0.3 and limited[1:] == free[1:] and limited[1] > 8 and weak[2] < 4 else 1)
CODE
