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
  the run's hash, metrics.

Nothing here opens a socket, and nothing runs while the robot does: the whole file is written from
the log in memory when the run is over.
"""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..runtime.stages import CheckedGraph
from .blueprint import recording_blueprint
from .robot_view import port_with_pose, write_robot
from .signal_names import element_names

POSE_RATE = 100.0
"""Pictures a second [Hz]: more than an eye sees, a fifth of the bytes."""
RECORDED_VERSIONS = ("aloft", "numpy", "mujoco-core", "pin", "qpsolvers", "daqp", "rerun-sdk")


class RunLog(Protocol):
    """What a recording needs to know of a run."""

    @property
    def graph(self) -> CheckedGraph:
        """The graph that ran."""

    @property
    def ticks(self) -> int:
        """How many ticks ran."""

    def names(self, port: str = "") -> Sequence[str]:
        """Every ``block.port.field``, or those of one port."""

    def signal(self, name: str) -> NDArray[Any]:
        """One field at every tick, (ticks, ...)."""


@dataclass(frozen=True)
class Recording:
    """A file that was written: where, how large, and how long it took [s]."""

    path: Path
    size: int
    seconds: float


def write_recording(path: Path, run: RunLog, properties: Mapping[str, Any]) -> Recording:
    """Write the whole run to ``path``, replacing what is there.

    Raises:
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """
    import rerun as rr

    began = time.perf_counter()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.open("wb").close()  # Rerun only logs a failure to open, so find out here
    # No wall-clock time and no random name: two recordings of one run hold the same data.
    stream = rr.RecordingStream(
        "aloft", recording_id=str(properties.get("run_hash", "run")), send_properties=False
    )
    rr.set_log_time_enabled(False, recording=stream)
    pose_port = port_with_pose(run.graph)
    stream.save(path, default_blueprint=recording_blueprint(run, pose_port))
    try:
        stream.log("graph", rr.TextDocument(run.graph.text, media_type="text/plain"), static=True)
        stream.send_property("aloft", rr.AnyValues(**describe(run.graph, properties)))
        ticks = np.arange(run.ticks, dtype=np.int64)
        write_signals(stream, run, time_columns(run.graph, ticks))
        write_states(stream, run)
        if pose_port is not None:
            rows = slice(None, None, max(1, round(run.graph.base_rate / POSE_RATE)))
            write_robot(stream, time_columns(run.graph, ticks[rows]), run, pose_port, rows)
    finally:
        stream.flush(timeout_sec=30)
        stream.disconnect()
    return Recording(path, path.stat().st_size, time.perf_counter() - began)


def time_columns(graph: CheckedGraph, ticks: NDArray[np.int64]) -> list[Any]:
    """The timelines ``t`` and ``tick``; nanoseconds as integers, because floats would round."""
    import rerun as rr

    nanoseconds = np.rint(ticks * (1e9 / graph.base_rate)).astype("timedelta64[ns]")
    return [rr.TimeColumn("t", duration=nanoseconds), rr.TimeColumn("tick", sequence=ticks)]


def write_signals(stream: Any, run: RunLog, columns: Sequence[Any]) -> None:
    """Write every field of every output as float64 series with a legend."""
    import rerun as rr

    for spec in run.graph.blocks:
        for port, output in spec.block_type.outputs.items():
            for name, field in output.signal.fields.items():
                values = run.signal(f"{spec.path}.{port}.{name}")
                entity = entity_of("signals", spec.path, port, name)
                names = element_names(field, values.shape[1:], run.graph.robot)
                if names:
                    stream.log(entity, rr.SeriesLines(names=names), static=True)
                flat = values.reshape(len(values), -1).astype(np.float64)
                stream.send_columns(entity, columns, rr.Scalars.columns(scalars=flat))


def write_states(stream: Any, run: RunLog) -> None:
    """Write each change of a field whose numbers have names, and the same as a line of text."""
    import rerun as rr

    for full_name, entity, values in named_states(run):
        numbers = run.signal(full_name)
        changes = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 1)).astype(np.int64)
        labels = [values.get(int(numbers[k]), str(numbers[k])) for k in changes]
        columns = time_columns(run.graph, changes)
        stream.send_columns(entity, columns, rr.StateChange.columns(state=labels))
        texts = [f"{full_name}: {label}" for label in labels]
        stream.send_columns(
            "events", columns, rr.TextLog.columns(text=texts, level=["INFO"] * len(texts))
        )


def named_states(run: RunLog) -> Iterable[tuple[str, str, Mapping[int, str]]]:
    """Every single number with named values: its full name, its entity, and the names."""
    for spec in run.graph.blocks:
        for port, output in spec.block_type.outputs.items():
            for name, field in output.signal.fields.items():
                if field.values is not None and not field.shape:
                    names = {int(v): v.name.lower() for v in field.values}
                    yield (
                        f"{spec.path}.{port}.{name}",
                        entity_of("states", spec.path, port, name),
                        names,
                    )


def entity_of(kind: str, block: str, port: str, field: str) -> str:
    """The entity path of a field; nested blocks nest."""
    return f"{kind}/{block}/{port}/{field}"


def describe(graph: CheckedGraph, properties: Mapping[str, Any]) -> dict[str, str]:
    """What is needed to repeat the run, and what came out, as texts."""
    seeds = {
        f"{spec.path}.seed": spec.params.seed
        for spec in graph.blocks
        if hasattr(spec.params, "seed")
    }
    return {
        "name": graph.name,
        "base_rate_hz": repr(graph.base_rate),
        "overrides": json.dumps(dict(graph.overrides)),
        "seeds": json.dumps(seeds),
        "versions": json.dumps(versions()),
        **{
            key: value if isinstance(value, str) else json.dumps(value)
            for key, value in properties.items()
        },
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
