#!/bin/sh
# asammdf 8.8.28 (MDF 4 of CAN loggers): invalidation bits mark samples that are not to be used, as of a sensor that was not ready. `get` leaves them out and `to_dataframe(raster=...)` interpolates over them. `MDF.resample` and
# `MDF.cut` interpolate between a valid sample and an invalid one, and mark the result valid.
# Expected: no number of a new recording comes from an invalid sample. Seen: 0, 1, (99 invalid), 3, 4 at 1 Hz: resampled to 2 Hz it has 50 at 1.5 s, a value that nobody measured; cut from 1.5 s on it begins
# with 50. With the usual codes of an invalid sensor (all bits set) the spike is thousands high. `to_dataframe` gives 1.5 there. Nothing is said.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from asammdf import MDF, Signal

times = np.arange(6.0)
samples = np.array([0.0, 1.0, 99.0, 3.0, 4.0, 5.0])
log = MDF(version="4.10")
log.append([Signal(samples, times, name="height", invalidation_bits=samples == 99.0)])
log.save("log.mf4")


def rows(log):
    signal = log.get("height")
    return dict(zip(signal.timestamps.tolist(), signal.samples.tolist()))


with MDF("log.mf4") as log:
    plain, resampled, cut = rows(log), rows(log.resample(0.5)), rows(log.cut(start=1.5, stop=3.5))
    frame = log.to_dataframe(raster=0.5)["height"].to_dict()
for name, found in {"get": plain, "resample(0.5)": resampled, "cut(1.5, 3.5)": cut, "to_dataframe(raster=0.5)": frame}.items():
    print(f"asammdf 8.8.28, {name}: {found}")
right = plain == {0.0: 0.0, 1.0: 1.0, 3.0: 3.0, 4.0: 4.0, 5.0: 5.0} and frame[1.5] == 1.5
sys.exit(0 if right and resampled[1.5] == cut[1.5] == 50.0 and 2.0 not in resampled else 1)
CODE
