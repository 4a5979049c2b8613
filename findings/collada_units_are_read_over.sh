#!/bin/sh
# A COLLADA file says what its numbers mean: <unit meter="0.0254"> is inches, as in many robot descriptions that were drawn in inches or
# millimetres, and RViz and Gazebo show them so. Pinocchio 4.1.0 (pin, by Coal 3.0.3), yourdfpy 0.0.60 and urchin 0.0.30 read the bare numbers as metres: collision
# shapes are 39 or 1000 times too large, without a warning. trimesh 5.2.0 keeps the unit as `units` and leaves the rest to its caller.
# Seen: a block of 3 mm, in metres 0.003 m high, in millimetres 3 m in all three readers.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "coal==3.0.3" "yourdfpy==0.0.60" "urchin==0.0.30" "trimesh==5.2.0" "pycollada==0.9.3" "numpy==2.4.6"
cd "$folder"
"$folder/venv/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
import pinocchio as pin
import trimesh
import urchin
import yourdfpy

DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><contributor/>
<created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified><unit name="unit" meter="{unit}"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g" name="g"><mesh><source id="p"><float_array id="a" count="12">{points}</float_array><technique_common>
<accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s" name="s"><node id="n" name="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
SHAPE = '<geometry><mesh filename="block.dae"/></geometry>'
with open("block.urdf", "w") as file:
    file.write(f'<robot name="r"><link name="block"><visual>{SHAPE}</visual><collision>{SHAPE}</collision></link></robot>')
told = {}
for unit in (1, 0.001):
    points = " ".join(f"{value * 0.001 / unit:g}" for value in (0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3))
    with open("block.dae", "w") as file:
        file.write(DAE.format(unit=unit, points=points))
    model = pin.buildModelFromUrdf("block.urdf")
    shape = pin.buildGeomFromUrdf(model, "block.urdf", pin.GeometryType.COLLISION, package_dirs=["."]).geometryObjects[0].geometry
    shape.computeLocalAABB()
    ours = yourdfpy.URDF.load("block.urdf", build_collision_scene_graph=True, load_collision_meshes=True).collision_scene.bounds[1, 2]
    theirs = next(iter(urchin.URDF.load("block.urdf").visual_trimesh_fk())).bounds[1, 2]
    told[unit] = np.round([shape.aabb_local.max_[2], ours, theirs], 6).tolist()
    units = trimesh.load("block.dae", force="mesh").units
    print(f"block of 3 mm, file in units of {unit} m ({units}): height in pin, yourdfpy, urchin {told[unit]} m")
sys.exit(0 if told == {1: [0.003] * 3, 0.001: [3.0] * 3} else 1)
CODE
