#!/bin/sh
# rerun-sdk 0.41.0: a Transform3D that is logged replaces the one before as a whole: so says its docstring, against the rule for all other archetypes. The rows of a data set's reader with `fill_latest_at=True` know nothing
# of it: translation, quaternion, axis and angle, and matrix are filled one by one, so a row holds parts of transforms of different times that never stood together.
# Expected: a filled row has the transform that is valid there: what was logged last. Seen: a quarter turn with a place, then a place alone (no turn any more), then a quaternion alone (no place any more):
# the filled rows have place and quarter turn, then place, quarter turn and quaternion. Poses computed from them are turned by 90 degrees and displaced.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check "rerun-sdk[catalog]==0.41.0" numpy==2.4.6 pandas==3.1.1
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import rerun as rr

stream = rr.RecordingStream("arm", send_properties=False)
stream.save("arm.rrd")
logged = (
    rr.Transform3D(translation=[1, 0, 0], rotation=rr.RotationAxisAngle([0, 0, 1], degrees=90)),
    rr.Transform3D(translation=[2, 0, 0]),
    rr.Transform3D(quaternion=[0, 0, 0, 1]),
    rr.Transform3D(mat3x3=[[2, 0, 0], [0, 2, 0], [0, 0, 2]]),
)
for tick, transform in enumerate(logged):
    stream.set_time("tick", sequence=tick)
    stream.log("hand", transform)
stream.flush()
stream.disconnect()

with rr.server.Server(datasets={"arms": ["arm.rrd"]}) as server:
    data = server.client().get_dataset("arms")
    frames = {filled: data.reader(index="tick", fill_latest_at=filled).sort("tick").to_pandas() for filled in (False, True)}
parts = {}
for filled, frame in frames.items():
    names = sorted(name for name in frame.columns if name.startswith("/hand:Transform3D:"))
    parts[filled] = [[name.rsplit(":", 1)[1] for name in names if row[name] is not None and len(row[name])] for _, row in frame.iterrows()]
    for tick, row in enumerate(parts[filled]):
        print(f"rerun-sdk 0.41.0, tick {tick}, {'filled' if filled else 'as logged'}: {', '.join(row)}")
documented = "fully reset to the new archetype" in rr.Transform3D.__doc__
print(f"the docstring says that a transform is replaced as a whole: {documented}")
turn, place = "rotation_axis_angle", "translation"
once = [[turn, place], [place], ["quaternion"], ["mat3x3"]]
piled = [[turn, place], [turn, place], ["quaternion", turn, place], ["mat3x3", "quaternion", turn, place]]
sys.exit(0 if documented and parts == {False: once, True: piled} else 1)
CODE
