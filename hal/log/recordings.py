"""Recordings of aloft as logs: a column for each signal's field, with the clock of its ticks."""

from __future__ import annotations

from pathlib import Path

from ...logs.file.reader import read
from .log_file import LogArray, LogFile


def read_recording(path: Path) -> LogFile:
    """Read the numbers of every signal."""
    run = read(path)
    log = LogFile(path)
    if run.header.robot is not None:
        log.texts["joints of the run"] = [joint.name for joint in run.header.robot.joints]
    for name, signal in run.signals().items():
        values = run[name]
        if len(values) < 2 or not values.size:
            log.refused[name] = "has one row" if values.size else "is empty"
            continue
        log.put(name, values.reshape(len(values), -1), len(values), signal.unit or None)
        if name in log.arrays and len(run.time) == len(values):
            kept = log.arrays[name]
            log.arrays[name] = LogArray(kept.values, run.time - run.time[0], kept.unit)
    return log
