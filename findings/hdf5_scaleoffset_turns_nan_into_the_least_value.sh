#!/bin/sh
# h5py 3.16.0 (HDF5's scale-offset filter): `create_dataset(..., scaleoffset=3)` keeps floats to three decimals, as logs of sensors are made small. A NaN in a chunk, the usual mark of a sample that
# is missing, is read back as the least value of its chunk, which looks like a measurement; the next chunk, without a NaN, is right. One infinity, or one value
# beyond about 10^16, in a chunk turns the filter off for that chunk. Nothing is said while it is written or read.
# Expected: NaN is kept, or refused. Seen: joint angles 0.5, NaN, -0.25, 1.0 are read as 0.5, -0.25, -0.25, 1.0; with gzip in place of it NaN stays NaN.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check h5py==3.16.0 numpy==2.4.6
cd "$folder"
"$folder/env/bin/python" - <<'CODE'
import sys

import h5py
import numpy as np

angles = np.array([0.5, np.nan, -0.25, 1.0] * 25)


def read_back(**settings):
    with h5py.File("log.h5", "w") as file:
        file.create_dataset("angle", data=angles, chunks=angles.shape, **settings)
    with h5py.File("log.h5") as file:
        return file["angle"][:]


lossy, zipped = read_back(scaleoffset=3), read_back(compression="gzip")
print(f"h5py {h5py.__version__}: {angles[:4]} is read as {lossy[:4]} with scaleoffset=3, as {zipped[:4]} with gzip")
print(f"mean of the {np.isfinite(angles).sum()} samples: {np.nanmean(angles):.3f}; of what is read {np.nanmean(lossy):.3f}, NaN left: {np.isnan(lossy).sum()}")
expected = np.where(np.isnan(angles), -0.25, angles)
sys.exit(0 if np.allclose(lossy, expected, atol=1e-3) and np.array_equal(zipped, angles, equal_nan=True) else 1)
CODE
