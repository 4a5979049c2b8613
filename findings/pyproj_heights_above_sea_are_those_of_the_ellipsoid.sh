#!/bin/sh
# pyproj 3.7.2: from the height of a GNSS receiver (above the WGS 84 ellipsoid, EPSG:4979) to that above the sea (EGM96, EPSG:4326+5773, or EGM2008, 4326+3855) the transformer that
# `Transformer.from_crs` makes gives the height back as it was: the wheel has no grids of the geoid, and the way that is left without them takes both heights for one.
# Expected: about 452 m for 500 m at Zurich, or an error that a grid is missing. Seen: 500 m, no error, no warning, also with only_best=True and errcheck=True; off by the geoid, -107 m to +85 m
# over the world. An altitude above the sea that is so computed for an autopilot flies into a hill. `transformer.accuracy` is -1; allow_ballpark=False refuses.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pyproj==3.7.2
PROJ_NETWORK=OFF PROJ_USER_WRITABLE_DIRECTORY="$folder" "$folder/env/bin/python" - <<'CODE'
import sys
import warnings

from pyproj import Transformer
from pyproj.exceptions import ProjError

# longitude and latitude (deg), and the geoid's height above the ellipsoid there, to some metres (m)
PLACES = {"Zurich": (8.55, 47.4, 48), "Sri Lanka": (80.0, 6.0, -100), "New Guinea": (147.0, -8.0, 75)}
heights, refused = [], 0
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    for model, code in {"EGM96": "EPSG:4326+5773", "EGM2008": "EPSG:4326+3855"}.items():
        for only_best in (False, True):
            transformer = Transformer.from_crs("EPSG:4979", code, always_xy=True, only_best=only_best)
            for place, (longitude, latitude, geoid) in PLACES.items():
                height = transformer.transform(longitude, latitude, 500.0, errcheck=True)[2]
                heights.append(height)
                print(
                    f"pyproj 3.7.2, {place}, only_best={only_best}: 500 m above the ellipsoid are {height:g} m above the sea of {model}, "
                    f"in truth about {500 - geoid}; accuracy {transformer.accuracy:g}"
                )
        try:
            Transformer.from_crs("EPSG:4979", code, always_xy=True, allow_ballpark=False)
        except ProjError:
            refused += 1
print(f"{len(said)} warnings; with allow_ballpark=False {refused} of 2 models are refused")
sys.exit(0 if set(heights) == {500.0} and not said and refused == 2 else 1)
CODE
