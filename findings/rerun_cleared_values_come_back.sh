#!/bin/sh
# rerun-sdk 0.41.0: `fill_latest_at=True` of a data set's reader fills each row with the value that was latest. At the row of a `Clear` the cleared entity is empty; in the row after it the value from before the
# Clear is back, and stays until the next one is logged. So it is with recursive clears, with rows that are asked for (`using_index_values`), and though the tombstone's column is filled beside it.
# Expected: what was cleared is empty until something is logged again, as the viewer, whose latest-at query this is, stops showing it. Seen: a foot's force of 102 N, cleared at lift-off, is
# empty for one tick and 102 N for the rest of the flight. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check "rerun-sdk[catalog]==0.41.0" numpy==2.4.6 pandas==3.1.1
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
import rerun as rr

stream = rr.RecordingStream("jump", send_properties=False)
stream.save("jump.rrd")


def log(tick, entity, what):
    stream.set_time("tick", sequence=tick)
    stream.log(entity, what)


for tick in range(7):
    log(tick, "height", rr.Scalars(float(tick)))
for tick in (0, 1, 2, 6):
    log(tick, "leg/force", rr.Scalars(100.0 + tick))
    log(tick, "foot", rr.Scalars(100.0 + tick))
log(3, "foot", rr.Clear(recursive=False))  # lift-off
log(3, "leg", rr.Clear(recursive=True))
stream.flush()
stream.disconnect()


def read(**settings):
    frame = data.reader(index="tick", fill_latest_at=True, **settings).sort("tick").to_pandas()
    return {name: [np.asarray(cell).tolist() for cell in frame[f"/{name}:Scalars:scalars"]] for name in ("foot", "leg/force")}


with rr.server.Server(datasets={"jumps": ["jump.rrd"]}) as server:
    data = server.client().get_dataset("jumps")
    found = {"": read(), "rows asked for": read(using_index_values=np.arange(7)), "with tombstones": read(include_tombstone_columns=True)}
for settings, columns in found.items():
    for name, cells in columns.items():
        print(f"rerun-sdk 0.41.0, cleared at tick 3, {settings or 'filled'}: {name} {cells}")
back = [[100.0], [101.0], [102.0], [], [102.0], [102.0], [106.0]]
sys.exit(0 if all(cells == back for columns in found.values() for cells in columns.values()) else 1)
CODE
