#!/bin/sh
# asammdf 8.8.28: `mdf.get(name, raster=0.1)` asks for samples 0.1 s apart. Where the length of the channel is a whole number of rasters, as of most recordings that were cut, it gives one sample less than fit, spread
# from the first to the last: 5 s at 0.1 s are 50 samples 0.10204 s apart. Where it is not, the step is right. `resample` and `to_dataframe` of the same package are always right.
# Expected: the raster that was asked for. Seen: 0.10204 s in place of 0.1, 0.5556 s in place of 0.5, 0.3 s for 0.3. Two channels of unlike length, taken with one raster, drift apart by up to one sample, and with
# samples_only=True nothing shows it: speeds taken as differences over 0.5 s are 11% too high. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from asammdf import MDF, Signal

times = np.linspace(0.0, 5.0, 501)
log = MDF(version="4.10")
log.append([Signal(2.0 * times, times, name="position")])  # m, at 2 m/s
steps = {}
for raster in (0.5, 0.1, 0.3):
    got, resampled = (signal.timestamps for signal in (log.get("position", raster=raster), log.resample(raster).get("position")))
    frame = log.to_dataframe(raster=raster).index.to_numpy()
    speed = float(np.diff(log.get("position", raster=raster, samples_only=True)[0]).mean() / raster)
    steps[raster] = tuple(round(float(np.diff(each).mean()), 5) for each in (got, resampled, frame))
    print(f"asammdf 8.8.28, raster {raster} s: steps of get {steps[raster][0]} s ({len(got)} samples), resample {steps[raster][1]}, to_dataframe {steps[raster][2]}; 2 m/s are {speed:.3f}")
sys.exit(0 if steps == {0.5: (0.55556, 0.5, 0.5), 0.1: (0.10204, 0.1, 0.1), 0.3: (0.3, 0.3, 0.3)} else 1)
CODE
