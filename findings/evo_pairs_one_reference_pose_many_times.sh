#!/bin/sh
# evo 1.38.1: `sync.associate_trajectories` (and evo_ape, evo_rpe) looks for a partner for every pose of the trajectory that has fewer poses in all. A fast estimate of a few seconds beside slow motion capture that ran for a minute has
# fewer: each pose of the reference is taken for several of the estimate, up to 10 ms away, and the way in between counts as error.
# Expected: each pose of either is in one pair at most, and what the reference does long after the estimate's end changes nothing. Seen: a perfect estimate at 500 Hz for 5 s, 2 m/s, reference at 100 Hz: if the reference is
# cut to 5 s, 500 pairs and errors of 0 (APE and RPE); if it runs for 60 s, 2,500 pairs of 500 reference poses, APE 5.7 mm rms and an RPE of one frame of 8 mm rms, more than the 4 mm of a frame. Nothing is said.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check evo==1.38.1 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D

SPEED = 2.0  # m/s


def straight(rate, seconds):
    times = np.arange(round(rate * seconds)) / rate
    places = np.column_stack((SPEED * times, np.zeros_like(times), np.zeros_like(times)))
    return PoseTrajectory3D(places, np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1)), times)


def errors(seconds):
    """Pairs, different poses of the reference in them, and APE and RPE (mm rms) of a perfect estimate."""
    reference, estimate = sync.associate_trajectories(straight(100.0, seconds), straight(500.0, 5.0), max_diff=0.01)
    rms = []
    for metric in (metrics.APE(metrics.PoseRelation.translation_part), metrics.RPE(metrics.PoseRelation.translation_part, 1, metrics.Unit.frames)):
        metric.process_data((reference, estimate))
        rms.append(round(1000 * metric.get_statistic(metrics.StatisticsType.rmse), 3))
    return len(reference.timestamps), len(set(reference.timestamps.tolist())), *rms


found = {seconds: errors(seconds) for seconds in (5.0, 20.0, 60.0)}
for seconds, (pairs, different, ape, rpe) in found.items():
    print(f"evo 1.38.1, reference of {seconds:g} s: {pairs} pairs of {different} reference poses, APE {ape} mm, RPE {rpe} mm")
short, longer, long = found.values()
sys.exit(0 if short == (500, 500, 0.0, 0.0) and longer[:2] == (501, 501) and longer[2] < 0.3 and long[0] == 2500 and long[1] <= 501 and 5 < long[2] < 7 and long[3] > 4 else 1)
CODE
