"""The content of a recording, defined in one place for the code that writes one and that reads one.

A recording is a Rerun file (``.rrd``). These entities hold a component ``aloft:record``, see ``records``; those with
``*`` are on the timelines ``t`` (exact nanoseconds) and ``tick``:

===================  ===============================================================================
``header``           JSON of ``Header``, without ``contents``
``files``            JSON of ``Header.contents``
``rows`` *           the bytes of the bus after each of some ticks without a gap, at most half a second of them; see
                     ``row_codec``
``held/N`` *         the same of the large fields of slow blocks, in the ticks in which these ran; see ``held_fields``
``keyframes`` *      the bytes of bus and state before tick k ran, from which a run can go on
``notes`` *          JSON of a list of ``Note``: life cycle, overruns, faults, parameter changes, dropped ticks
``outcome``          JSON of ``RunResult.to_json``, written last, so a recording without it was cut off
``end/0, 1``         what closes the file
===================  ===============================================================================

The others are for the viewer; ``B/P/F`` stands for a block's path, an output and a field:

===================  ===============================================================================
``__properties``     the main parts of the header and of the outcome
``graph``            the graph as it ran, after includes, sub-graphs and overrides, as text
``signals/B/P/F``    the curve of a field as ``Scalars``: of those in the plots that it shows first, and of as many
                     ticks as the curve needs; see ``drawing``
``states/NAME``      each change of a number whose values have names, and of a truth value;
                     ``state_lanes.all_lanes`` chooses the short names
``limits/B/P/F``     the limits of a field by the robot's description
``plots``            what is computed for plots only: see ``contacts``
``events``           notes, changes of state, lift-off and touchdown as text
``world``            the robot in 3D; see ``scene``
``times``            the time each block took, as text; written last
===================  ===============================================================================

Row k is the bus after all outputs of tick k were written. ``viewing.drawing`` says how much is drawn into a recording.
The other curves, and the rest of the scene, are drawn from the rows when ``aloft view`` shows it.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from hashlib import blake2b
from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...robots.robot_description import RobotDescription
from ...robots.terrain import Ground, HeightField, Terrain
from ...runtime.language.layout import Layout
from ...runtime.language.signals import Slot

MOST_OF_BUFFER = 1 << 30
"""Bytes of a bus or a state, at most."""
FORMAT = 7
"""The number of this format, the only one that is read."""
SIGNALS, STATES, EVENTS = "signals", "states", "events"
LIMITS, TIMES, WORLD, GRAPH, DIAGRAM = "limits", "times", "world", "graph", "diagram"
PLOTS = "plots"
RECORD = "record"


@dataclass(frozen=True)
class RecordedField:
    """One field of the bus or of the state, without the code that declared it.

    Attributes:
        name: ``block.port.field``.
        dtype: ``float64``, ``int64`` or ``bool``.
        start: where it begins in its section of the buffer.
        shape: its shape in numbers.
        dimensions: its shape as declared (``n_joints``).
        unit, frame, text: as declared.
        values: the names of the numbers of an int64 field.
        constant: whether it belongs to an unwired input.
        signals: the name of the signal's class, and those of the signals that it derives from.
    """

    name: str
    dtype: str
    start: int
    shape: tuple[int, ...]
    dimensions: tuple[int | str, ...]
    unit: str | None = None
    frame: str | None = None
    text: str = ""
    values: Mapping[int, str] = field(default_factory=dict)
    constant: bool = False
    signals: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """The number of elements."""
        return prod(self.shape)

    @property
    def field_name(self) -> str:
        """The last part of the name."""
        return self.name.rpartition(".")[2]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Read the field from the plain data that ``dataclasses.asdict`` made."""
        values = {int(number): name for number, name in data["values"].items()}
        tuples = {name: tuple(data[name]) for name in ("shape", "dimensions", "signals")}
        return cls(**{**data, "values": values, **tuples})


@dataclass(frozen=True)
class RecordedLayout:
    """The places of all fields in a buffer of ``size`` bytes; see ``runtime.layout``."""

    fields: tuple[RecordedField, ...]
    lengths: Mapping[str, int]
    offsets: Mapping[str, int]
    size: int

    def layout(self) -> Layout:
        """Return the layout as the runtime uses it."""
        slots = {f.name: Slot(f.dtype, f.start, f.shape) for f in self.fields}
        return Layout(slots, dict(self.lengths), dict(self.offsets), self.size)

    def schema_hash(self) -> str:
        """Return 16 hexadecimal digits that are equal for equal names, types, shapes, units and
        frames."""
        parts = [[f.name, f.dtype, f.start, f.shape, f.unit, f.frame] for f in self.fields]
        return blake2b(json.dumps(parts).encode(), digest_size=8).hexdigest()

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Read the layout from the plain data that ``dataclasses.asdict`` made."""
        fields = tuple(RecordedField.from_json(entry) for entry in data["fields"])
        return cls(fields, data["lengths"], data["offsets"], data["size"])


@dataclass(frozen=True)
class RecordedBlock:
    """One block: its type as ``module:Class``, when it runs and the folder of its graph file.

    ``ports`` are those of a block that needs code which is not aloft's, as plain data, so that the graph can
    be drawn without it; see ``header``.
    """

    path: str
    type: str
    period_ticks: int
    offset_ticks: int
    folder: str
    ports: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Header:
    """Everything that is known before the first tick.

    Attributes:
        name: the name of the graph.
        graph: the graph's text after flattening.
        base_rate: the number of ticks in a second [Hz].
        first_tick: zero, except for a run that began at a snapshot, and for the later files of a run
            that was recorded into several.
        run_begin: in such a later file, the first tick of the run.
        clock: ``free``, ``paced`` or ``robot``.
        ticks: the number of ticks that the graph runs, if it has a duration.
        overrides: the overrides of the graph file, by what they set.
        seeds: the parameters called ``seed``, as ``block.seed``.
        parameters: every other parameter that is a number or a text, as ``block.name``.
        versions: the versions of Python and of every package that computes something.
        machine: what else equal bytes depend on: processor, system and BLAS.
        blocks: the blocks in the order of the file.
        order: the blocks' paths in the order of execution.
        bus, state: the layouts of both buffers.
        bus_start: the bytes of the bus before the first tick.
        robot: the robot's description, if the graph has one.
        source: the graph file as it was named for the run.
        terrain: the ground of the simulated world, if there is one.
        files: the SHA-256 of each file that a parameter names or a block has read, such as plans.
        contents: the content of these files by their SHA-256, compressed, as text.
        project: the git commit of the project that the graph's file belongs to.
    """

    name: str
    graph: str
    base_rate: float
    bus: RecordedLayout
    state: RecordedLayout
    bus_start: bytes
    first_tick: int = 0
    run_begin: int | None = None
    clock: str = "free"
    ticks: int | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)
    seeds: Mapping[str, int] = field(default_factory=dict)
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    machine: Mapping[str, str] = field(default_factory=dict)
    blocks: tuple[RecordedBlock, ...] = ()
    order: tuple[str, ...] = ()
    robot: RobotDescription | None = None
    source: str = ""
    terrain: Terrain | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    contents: Mapping[str, str] = field(default_factory=dict)
    project: str = ""
    format: int = FORMAT

    @property
    def earlier_ticks(self) -> int:
        """The ticks of the run before the first tick of this file."""
        return 0 if self.run_begin is None else self.first_tick - self.run_begin

    @property
    def schema_hashes(self) -> dict[str, str]:
        """The schema hashes of the bus and of the state."""
        return {"bus": self.bus.schema_hash(), "state": self.state.schema_hash()}

    def expect_possible(self) -> None:
        """Check that every field lies in its buffer. Raises ``ValueError``."""
        for layout, name in ((self.bus, "bus"), (self.state, "state")):
            if not 0 <= layout.size <= MOST_OF_BUFFER:
                raise ValueError(f"the {name} has {layout.size} bytes")
            slots = layout.layout()
            for each in layout.fields:
                begin, end = slots.byte_range(each.name)
                if not 0 <= begin <= end <= layout.size or min(each.shape, default=0) < 0:
                    raise ValueError(f"the field {each.name} does not lie in the {name}")
        if len(self.bus_start) not in (0, self.bus.size):
            raise ValueError(f"the bus has {self.bus.size} bytes, not {len(self.bus_start)}")

    def to_json(self) -> str:
        """Write the header as JSON text."""
        data = _plain(self) | {"schema_hashes": self.schema_hashes}
        data["robot"] = self.robot and self.robot.model_dump(mode="json", context={"looks": True})
        data["bus_start"] = b64encode(self.bus_start).decode()
        return json.dumps(data, default=_plain)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Read the header that ``to_json`` wrote."""
        data = json.loads(text)
        del data["schema_hashes"]
        robot = data["robot"]
        data["robot"] = robot and RobotDescription.model_validate(robot)
        data["bus"] = RecordedLayout.from_json(data["bus"])
        data["state"] = RecordedLayout.from_json(data["state"])
        data["bus_start"] = b64decode(data["bus_start"])
        data["blocks"] = tuple(RecordedBlock(**block) for block in data["blocks"])
        data["order"] = tuple(data["order"])
        data["terrain"] = _terrain(data["terrain"])
        return cls(**data)


def _plain(value: Any) -> dict[str, Any]:
    """Return the values of a dataclass or of a mapping, which are not copied."""
    if isinstance(value, Mapping):
        return dict(value)
    return {each.name: getattr(value, each.name) for each in fields(value)}


def _terrain(data: Mapping[str, Any] | None) -> Terrain | None:
    """Read the terrain from plain data; a run without a simulated world has none."""
    if data is None:
        return None
    blocks, fields = data["blocks"], data.get("fields", ())
    return Terrain(
        data["floor"],
        tuple(Ground(**_tuples(block)) for block in blocks),
        tuple(HeightField(**_tuples(field)) for field in fields),
        data.get("uneven", 0.0),
    )


def _tuples(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a dataclass from plain data, with tuples for lists."""

    def convert(value: Any) -> Any:
        return tuple(map(convert, value)) if isinstance(value, list | tuple) else value

    return {name: convert(value) for name, value in data.items()}


@dataclass(frozen=True)
class RecordedRows:
    """Some ticks of a run, (n,), and the bytes of the bus after each of them, ``rows`` (n, bytes)."""

    header: Header
    ticks: NDArray[np.int64]
    rows: NDArray[np.uint8]
    layout: Layout

    def fields(self) -> list[RecordedField]:
        """Return every field of every output, in file order."""
        return [entry for entry in self.header.bus.fields if not entry.constant]

    def signal(self, name: str) -> NDArray[Any]:
        """Return one field at every tick, (n, ...). Raises ``KeyError``."""
        return self.layout.view(self.rows, name)


def entity_of(kind: str, name: str) -> str:
    """Return the entity that holds ``block.port.field``; nested blocks nest."""
    return f"{kind}/{name.replace('.', '/')}"


def nanoseconds(base_rate: float, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the instant of every tick on the timeline ``t``, as integers, because floats would
    round."""
    instants: NDArray[np.int64] = np.rint(ticks * (1e9 / base_rate)).astype(np.int64)
    return instants


def spans(ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return first and last (m, 2) of each stretch without a gap of ``ticks`` (n,), which are in
    order."""
    ends = np.flatnonzero(np.diff(ticks) != 1)
    first = np.concatenate([ticks[:1], ticks[ends + 1]])
    return np.stack([first, np.concatenate([ticks[ends], ticks[-1:]])], axis=1)


def time_columns(header: Header, ticks: NDArray[np.int64]) -> list[Any]:
    """Return the timelines ``t`` and ``tick`` at some ticks (n,)."""
    import rerun as rr

    instants = nanoseconds(header.base_rate, ticks).astype("timedelta64[ns]")
    return [rr.TimeColumn("t", duration=instants), rr.TimeColumn("tick", sequence=ticks)]


def timed(header: Header, ticks: NDArray[np.int64], texts: Sequence[str]) -> list[str]:
    """Write the time before each text, as the viewer's own column of times is too narrow for them."""
    times = (ticks / header.base_rate).tolist()
    return [f"{time:.3f} s  {text}" for time, text in zip(times, texts, strict=True)]
