#!/bin/sh
# Coal 3.0.3 (with Pinocchio 4.1.0): a mesh as it is loaded is a surface without an inside. A ball that is wholly inside of it does not collide,
# and its signed distance is positive, as if it were clear; the convex hull of the same mesh and the box of the same size say how
# deep it is. `buildGeomFromUrdf` gives such surfaces for every <mesh>. A planner that checks single poses finds a path through a wall:
# a hand that is deeper in it than its own size is free. Build convex hulls first.
# Seen: a ball of 0.1 m in the middle of a mesh of a 1 m cube: no collision, distance +0.4 m; hull and box -0.6 m.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pin==4.1.0" "coal==3.0.3" "trimesh==5.2.0" "numpy==2.4.6" "scipy==1.17.1"
cd "$folder"
"$folder/venv/bin/python" - <<'CODE'
import sys

import coal
import numpy as np
import pinocchio as pin
import trimesh

trimesh.creation.box((1, 1, 1)).export("cube.stl")
with open("cube.urdf", "w") as file:
    file.write('<robot name="r"><link name="wall"><collision><geometry><mesh filename="cube.stl"/></geometry></collision></link></robot>')
model = pin.buildModelFromUrdf("cube.urdf")
mesh = pin.buildGeomFromUrdf(model, "cube.urdf", pin.GeometryType.COLLISION, package_dirs=["."]).geometryObjects[0].geometry
mesh.buildConvexHull(True, "Qt")
ball, told = coal.Sphere(0.1), {}
for x in (0.0, 0.3, 0.45, 0.7):
    for name, shape in {"mesh": mesh, "hull": mesh.convex, "box": coal.Box(1, 1, 1)}.items():
        at = (shape, coal.Transform3s(), ball, coal.Transform3s(np.eye(3), np.array([x, 0.0, 0.0])))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        request.enable_signed_distance = True
        hit = coal.collide(*at, coal.CollisionRequest(), coal.CollisionResult()) > 0
        told[x, name] = (hit, float(round(coal.distance(*at, request, result), 3)))
    print(f"coal 3.0.3: ball at {x} m: " + ", ".join(f"{n} {told[x, n]}" for n in ("mesh", "hull", "box")))
inside = [told[x, "mesh"] for x in (0.0, 0.3)] == [(False, 0.4), (False, 0.1)]
solid = all([told[x, n] for x in (0.0, 0.3)] == [(True, -0.6), (True, -0.3)] for n in ("hull", "box"))
sys.exit(0 if inside and solid and told[0.45, "mesh"][0] and told[0.7, "mesh"] == told[0.7, "box"] == (False, 0.1) else 1)
CODE
