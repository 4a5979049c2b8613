#!/bin/sh
# Pinocchio 4.1.0 (pin): settings of an MJCF file that decide what a robot weighs are read over without a word: `gravity` of
# <option> (model.gravity stays that of the Earth), `inertiagrouprange` (visual geoms are weighed with the others), `boundmass`
# and `boundinertia`, and `gravcomp` of a body. MuJoCo's masses and torques are others.
# Seen: gravity 1.62: torque 6.1 times too large; inertiagrouprange 2 3: 6 kg for 1; boundmass 0.5: 0.1 kg for 0.5; gravcomp 1: a
# torque at rest for none.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "mujoco-core==4.0.1" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" - <<'CODE'
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

FILE = """<mujoco>{0}<worldbody><body pos="0 0 1" {1}><joint axis="0 1 0"/><geom size=".05" pos=".1 0 0" mass="{2}" group="2"/>{3}
  </body></worldbody></mujoco>"""
CASES = {
    "none": ("", "", 1, ""),
    "gravity": ('<option gravity="0 0 -1.62"/>', "", 1, ""),
    "inertiagrouprange": ('<compiler inertiagrouprange="2 3"/>', "", 1, '<geom size=".1" mass="5" group="0"/>'),
    "boundmass": ('<compiler boundmass="0.5"/>', "", 0.1, ""),
    "gravcomp": ("", 'gravcomp="1"', 1, ""),
}
rows = {}
for name, parts in CASES.items():
    text = FILE.format(*parts)
    Path("robot.xml").write_text(text)
    simulated, model = mujoco.MjModel.from_xml_string(text), pinocchio.buildModelFromMJCF("robot.xml")
    data = mujoco.MjData(simulated)
    mujoco.mj_inverse(simulated, data)
    rest = np.zeros(1)
    torque = pinocchio.rnea(model, model.createData(), rest, rest, rest)[0]
    rows[name] = (simulated.body_mass[1], model.inertias[1].mass, data.qfrc_inverse[0], torque)
    print(f"pinocchio {pinocchio.__version__}: {name}: MuJoCo {rows[name][0]:.2f} kg, {rows[name][2]:.3f} N m, Pinocchio {rows[name][1]:.2f} kg, {torque:.3f} N m")
alike = {name: bool(np.isclose(own[0], own[1]) and np.isclose(own[2], own[3])) for name, own in rows.items()}
sys.exit(0 if alike == {name: name == "none" for name in CASES} else 1)
CODE
