"""A run as one Rerun file: every signal of every tick, exactly, and the robot in 3D.

In the file:

* ``signals/<block>/<port>/<field>``: the field's numbers as one entity of float64 series, on the
  timelines ``t`` (exact nanoseconds of the tick) and ``tick``. One entity a field, not a port: it
  costs a fifth more bytes, and every field can then be plotted by itself. Integers up to 2^53 and
  booleans are exact as float64 too.
* ``states/<block>/<port>/<field>``: a change of state wherever a field whose numbers have names
  changes, and ``events``: the same as text.
* ``world``: the robot, forces and centre of mass, at 100 Hz; see ``robot_view``.
* ``graph``: the graph as it ran, as text; and the properties ``aloft``: overrides, seeds, versions,
  the run's hash and its outcome.

Nothing here opens a socket, and nothing runs while the robot does: the whole file is written from
the log in memory when the run is over.
"""

from __future__ import annotations

import json
import platform
import time
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..runtime.run_result import RunResult
from ..runtime.stages import CheckedGraph
from .blueprint import recording_blueprint
from .logged_run import LoggedRun, entity_of, time_columns
from .robot_view import port_with_pose, write_robot
from .signal_names import element_names

RECORDED_VERSIONS = ("aloft", "numpy", "mujoco-core", "pin", "qpsolvers", "daqp", "rerun-sdk")


@dataclass(frozen=True)
class Recording:
    """A file that was written: where, how large, and how long it took [s]."""

    path: Path
    size: int
    seconds: float


def write_recording(path: str | PathLike[str], result: RunResult) -> Recording:
    """Write a whole run, also one that failed, to ``path``, replacing what is there.

    Raises:
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
        RuntimeError: the run kept no log.
    """
    import rerun as rr

    began = time.perf_counter()
    run = LoggedRun.of(result)
    graph, path = run.graph, Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.open("wb").close()  # Rerun would only warn, so find out here whether it can be written
    # No wall-clock time and no random name: two recordings of one run hold the same data.
    stream = rr.RecordingStream(
        "aloft", recording_id=result.run_hash or graph.name, send_properties=False
    )
    rr.set_log_time_enabled(False, recording=stream)
    pose_port = port_with_pose(graph)
    stream.save(path, default_blueprint=recording_blueprint(run, pose_port))
    try:
        stream.log("graph", rr.TextDocument(graph.text, media_type="text/plain"), static=True)
        stream.send_property("aloft", rr.AnyValues(**describe(graph, result)))
        if len(run.ticks):
            write_signals(stream, run)
            write_states(stream, run)
            if graph.robot is not None and pose_port is not None:
                write_robot(stream, run, graph.robot, pose_port)
    finally:
        stream.flush(timeout_sec=30)
        stream.disconnect()
    return Recording(path, path.stat().st_size, time.perf_counter() - began)


def write_signals(stream: Any, run: LoggedRun) -> None:
    """Write every field of every output as float64 series with a legend."""
    import rerun as rr

    columns = time_columns(run.graph, run.ticks)
    for name, field in run.fields():
        values = run.signal(name)
        entity = entity_of("signals", name)
        names = element_names(field, values.shape[1:], run.graph.robot)
        if names:
            stream.log(entity, rr.SeriesLines(names=names), static=True)
        flat = values.reshape(len(values), -1).astype(np.float64)
        stream.send_columns(entity, columns, rr.Scalars.columns(scalars=flat))


def write_states(stream: Any, run: LoggedRun) -> None:
    """Write each change of a number whose values have names, and the same as a line of text."""
    import rerun as rr

    for name, field in run.fields():
        if field.values is None or field.shape:
            continue
        numbers = run.signal(name)
        changes = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))
        known = {int(value): value.name.lower() for value in field.values}
        labels = [known.get(int(number), str(number)) for number in numbers[changes]]
        columns = time_columns(run.graph, run.ticks[changes])
        stream.send_columns(
            entity_of("states", name), columns, rr.StateChange.columns(state=labels)
        )
        texts = [f"{name}: {label}" for label in labels]
        levels = ["INFO"] * len(texts)
        stream.send_columns("events", columns, rr.TextLog.columns(text=texts, level=levels))


def describe(graph: CheckedGraph, result: RunResult) -> dict[str, str]:
    """What is needed to repeat the run, and what came of it, as texts."""
    seeds = {
        f"{spec.path}.seed": spec.params.seed
        for spec in graph.blocks
        if hasattr(spec.params, "seed")
    }
    return {
        "name": graph.name,
        "graph": graph.text,
        "base_rate_hz": repr(graph.base_rate),
        "overrides": json.dumps(dict(graph.overrides)),
        "seeds": json.dumps(seeds),
        "versions": json.dumps(versions()),
        "run_hash": result.run_hash,
        "outcome": json.dumps(result.to_json()),
    }


def versions() -> dict[str, str]:
    """The versions of Python and of every package that computes something in a run."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in RECORDED_VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
