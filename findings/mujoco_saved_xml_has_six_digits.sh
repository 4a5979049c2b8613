#!/bin/sh
# MuJoCo 4.0.1 (mujoco-core): MJCF that is written by `MjSpec.to_xml` (and by mj_saveLastXML) has six significant digits of each number. A model that is
# saved and read again is another one: what stands far from the origin has moved by millimetres, masses and limits differ in
# the seventh digit, and a time step of 1/3000 s is no longer that: a clock of a thousand seconds is 1 ms late.
# Seen: a robot at 1234.5678 m is read at 1234.57 m; a mass of 1.23456789 kg as 1.23457; 3 million steps of 1/3000 s are 999.999 s.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "mujoco-core==4.0.1" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'CODE'
import sys

import mujoco

MJCF = """<mujoco><option timestep="0.000333333333333333"/><worldbody><body pos="1234.5678 0 0"><joint axis="0 0 1" range="-90.123456 90"/>
<inertial pos="0 0 0" mass="1.23456789" diaginertia="0.00123456789 0.00123456789 0.00123456789"/></body></worldbody></mujoco>"""
spec = mujoco.MjSpec.from_string(MJCF)
first = spec.compile()
again = mujoco.MjModel.from_xml_string(spec.to_xml())
loaded = mujoco.MjModel.from_xml_string(MJCF)
mujoco.mj_saveLastXML("saved.xml", loaded)
saved = mujoco.MjModel.from_xml_path("saved.xml")
rows = [(float(m.body_pos[1, 0]), float(m.body_mass[1]), float(m.jnt_range[0, 0]), 3_000_000 * m.opt.timestep) for m in (first, again, saved)]
for name, row in zip(("compiled", "to_xml", "mj_saveLastXML"), rows):
    print(f"mujoco 4.0.1: {name}: x {row[0]} m, mass {row[1]} kg, limit {row[2]:.9f} rad, 3 million steps {row[3]:.4f} s")
right = rows[0][0] == 1234.5678 and abs(rows[0][3] - 1000) < 1e-6
sys.exit(0 if right and all(row[0] == 1234.57 and row[1] == 1.23457 and abs(row[3] - 999.999) < 1e-6 for row in rows[1:]) else 1)
CODE
