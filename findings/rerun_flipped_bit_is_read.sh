#!/bin/sh
# Rerun 0.41.0 (rerun-sdk): an .rrd file has a checksum over its index at the end, and none over the data. A file in which one bit
# of a number has changed, as on a worn disk, passes `rerun rrd verify`, and RrdReader gives another number without a word.
# Seen: of 1000 random numbers, number 500 is read as 1.7929 in place of 1.2929; all others are right.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder/packages" rerun-sdk==0.41.0 numpy==2.4.6
cd "$folder"
PYTHONPATH="$folder/packages" python3 - <<'CODE'
import subprocess
import sys

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

values = np.random.default_rng(0).standard_normal(1000)


def read(name):
    for chunk in RrdReader(name).stream():
        batch = chunk.to_record_batch()
        if "Scalars:scalars" in batch.schema.names:
            return np.array([row[0] for row in batch["Scalars:scalars"].to_pylist()])


def verified(name):
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", name]
    return subprocess.run(command, capture_output=True).returncode == 0


stream = rr.RecordingStream("checked", recording_id="checked", send_properties=False)
stream.save("whole.rrd")
ticks = rr.TimeColumn("tick", sequence=np.arange(1000))
stream.send_columns("a", [ticks], rr.Scalars.columns(scalars=values))
stream.flush()
stream.disconnect()
data = bytearray(open("whole.rrd", "rb").read())
place = data.find(values[500].tobytes())  # random numbers do not compress, so they stand as they are
if place < 0:
    sys.exit("the number does not stand in the file as it is")
data[place + 6] ^= 8
open("flipped.rrd", "wb").write(data)
whole, flipped = read("whole.rrd"), read("flipped.rrd")
wrong = np.flatnonzero(flipped != values).tolist()
print(f"Rerun {rr.__version__}: number 500 is {values[500]}, and {flipped[500]} with one bit flipped; wrong: {wrong}; "
      f"verified: {verified('whole.rrd')}, {verified('flipped.rrd')}")
sys.exit(0 if np.array_equal(whole, values) and wrong == [500] and verified("flipped.rrd") else 1)
CODE
