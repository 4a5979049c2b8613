"""The linear model of a whole graph about one instant of a run, by numerical differentiation.

With the state x[k] before a period of all rates, the inputs u added to chosen signals, and the outputs y::

    x[k+1] = A x[k] + B u[k],    y[k] = C x[k] + D u[k]

Every column is a central difference with Richardson's extrapolation; its step is chosen by the error that
two steps show. In a graph of several rates the period is the least common one, and inputs and outputs are
lifted: one for each time in the period that the signal's block runs, named with ``@tick`` (Chen and
Francis, Optimal Sampled-Data Control Systems, chapter 8).

Contacts, modes and all else that is no float stay as they are in the undisturbed run. What this leaves out
is named in ``Linearisation.held`` and ``Linearisation.uncertain``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...files.pip_line import pip_line
from ...logs.file.format import RecordedField
from ...logs.file.header import recorded_signals
from ...mathematics.arrays import Array, Flags
from ...runtime.background.background_block import BackgroundBlock
from ...runtime.graph import Graph, load
from ...runtime.language.errors import AloftError
from ...runtime.running.region import Region
from ...runtime.running.stepping import SteppedRun
from .coordinates import (
    Coordinates,
    bus_coordinates,
    signal_coordinates,
    state_coordinates,
)
from .instant import bound_graph, go_to
from .period import Period

if TYPE_CHECKING:
    from control import StateSpace

PROBE = 1e-7
"""The displacement, relative to the larger of 1 and the value, by which influence is looked for."""
STEP = 1e-6
"""The first step of a difference, relative likewise."""
FACTORS = (1.0, 10.0, 0.1, 100.0)
"""The multiples of it that are tried until the error is small enough."""
TOLERANCE = 1e-6
"""The relative error of a column at which no other step is tried."""
KINK = 1e-2
"""The relative difference of the slopes ahead and behind at which a column is called uncertain."""


@dataclass(frozen=True)
class Held:
    """Block that a linear model holds constant, with the reason why it could not be differentiated."""

    block: str
    reason: str

    def __str__(self) -> str:
        return f"{self.block}: {self.reason}"


@dataclass(frozen=True)
class Linearisation:
    """A linear model of a graph.

    Attributes:
        a, b, c, d: its matrices, (n, n), (n, m), (p, n) and (p, m).
        states, inputs, outputs: the names, such as ``estimator.estimate.position[x]``.
        state_units, input_units, output_units: their units.
        values: the states in the instant, (n,); zero for rotations, which are relative to it.
        tick, period: the instant, and the time between two states [s].
        ticks: the ticks of the graph in a period.
        base_period: the time of a tick [s].
        held: the blocks between inputs and outputs of which something could not be differentiated.
        uncertain: the states and inputs whose column has an error above 1 %, with that error: there a
            limit, a contact or a rounding is near.
        unused: how many float elements of state are left out, because no input reaches them or they reach
            no output.
        opened: whether the inputs open the wires.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state_units: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    values: Array
    tick: int
    period: float
    ticks: int
    base_period: float
    held: tuple[Held, ...]
    uncertain: Mapping[str, float]
    unused: int
    opened: bool
    input_ticks: tuple[int, ...] = field(default=(), repr=False)
    output_ticks: tuple[int, ...] = field(default=(), repr=False)

    @property
    def system(self) -> StateSpace:
        """The model as python-control has it, with named states, inputs and outputs.

        Raises:
            AloftError: python-control is not installed.
        """
        control = import_control()
        made: StateSpace = control.StateSpace(
            self.a, self.b, self.c, self.d, self.period, states=_control_names(self.states),
            inputs=_control_names(self.inputs), outputs=_control_names(self.outputs),
            remove_useless_states=False,
        )  # fmt: skip
        return made

    @property
    def poles(self) -> Any:
        """The eigenvalues of A, (n,), complex, the slowest first."""
        return sorted_poles(self.a)

    def response(self, frequency: Array) -> Any:
        """Return the frequency response, (frequencies, outputs, inputs), complex, at frequencies in rad/s.

        Of a graph of several rates it is the part of each output that has the input's own frequency, with
        one row and column for each signal.
        """
        w = np.asarray(frequency, np.float64)
        n = len(self.a)
        z = np.exp(1j * w * self.period)
        values, vectors = np.linalg.eig(self.a) if n else (np.zeros(0), np.zeros((0, 0)))
        if n and np.linalg.cond(vectors) < 1e8:
            left, right = self.c @ vectors, np.linalg.solve(vectors, self.b.astype(complex))
            whole = self.d + (left[None] / (z[:, None, None] - values)) @ right
        else:
            eye = np.eye(n)
            whole = np.array([self.d + self.c @ np.linalg.solve(each * eye - self.a, self.b) for each in z])  # fmt: skip
        if self.ticks == 1:
            return whole
        ins, outs = _groups(self.inputs), _groups(self.outputs)
        t_in = np.array(self.input_ticks) * self.base_period
        t_out = np.array(self.output_ticks) * self.base_period
        shifted = whole * np.exp(-1j * w[:, None, None] * (t_out[:, None] - t_in))
        found = np.zeros((len(w), len(outs), len(ins)), complex)
        for i, rows in enumerate(outs.values()):
            for j, columns in enumerate(ins.values()):
                found[:, i, j] = shifted[:, rows][:, :, columns].sum(axis=(1, 2)) / len(rows)
        return found

    def as_data(self) -> dict[str, Any]:
        """Return all fields as plain data."""
        poles = self.poles
        return {
            "tick": self.tick, "period_s": self.period, "opened": self.opened,
            "states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs),
            "state_units": list(self.state_units), "input_units": list(self.input_units),
            "output_units": list(self.output_units), "a": self.a.tolist(), "b": self.b.tolist(),
            "c": self.c.tolist(), "d": self.d.tolist(),
            "poles": [[float(p.real), float(p.imag)] for p in poles],
            "held": [{"block": each.block, "reason": each.reason} for each in self.held],
            "uncertain": dict(self.uncertain), "unused_states": self.unused,
        }  # fmt: skip


def sorted_poles(a: Array) -> Any:
    """Return the eigenvalues of A, (n,), complex, the slowest first."""
    found = np.linalg.eigvals(a)
    return found[np.argsort(-np.abs(found), kind="stable")]


def import_control() -> Any:
    """Return the package python-control. Raises ``AloftError`` where it is not installed."""
    try:
        import control
    except ImportError as error:
        raise AloftError(
            f"python-control is not installed; install it with: {pip_line('analysis')}"
        ) from error
    return control


def linearise(
    graph: Graph | SteppedRun | str | Path,
    *,
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    at: float | None = None,
    when: str = "",
    opened: bool = False,
) -> Linearisation:
    """Return the linear model from some signals of a graph to others.

    Args:
        graph: a graph or its file, which is run up to the instant, or a run that has come to it. A run
            is left where it was.
        inputs: signals such as ``joint_pd.command.torque[*_knee]``. A small value is added between the
            block that writes the signal and all that read it.
        outputs: the signals that are observed, likewise. A signal that is an input as well is observed
            before the value is added, so an opened wire from itself to itself gives its loop's transfer.
        at: the instant [s].
        when: a condition such as ``phase.phase == STAND``; the first instant at which it holds. With
            ``at``, the first from then on.
        opened: open the loop at the inputs: what is read there does not follow what the block writes.

    Raises:
        AloftError: there is no such signal or instant, or a run from a snapshot does not repeat itself,
            which names the block that keeps something outside its declared state.
        RunError: a block failed on the way.
    """
    if isinstance(graph, SteppedRun):
        run = graph
        go_to(run, at, when)
        before = run.snapshot()
        try:
            return _linearise(run, _texts(inputs), _texts(outputs), opened)
        finally:
            run.restore(before)
    loaded = graph if isinstance(graph, Graph) else load(graph)
    with loaded.open() as run:
        return linearise(run, inputs=inputs, outputs=outputs, at=at, when=when, opened=opened)


def _texts(names: str | Sequence[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _linearise(
    run: SteppedRun, input_texts: Sequence[str], output_texts: Sequence[str], opened: bool
) -> Linearisation:
    bound = bound_graph(run)
    signals = {field.name: field for field in recorded_signals(bound)}
    inputs = [signal_coordinates(bound, signals, text) for text in input_texts]
    outputs = [signal_coordinates(bound, signals, text) for text in output_texts]
    if any(each.quaternion for each in inputs):
        raise AloftError("an orientation cannot be an input: a value is added to it; choose a rate")
    period = Period(bound, inputs, outputs, held=opened)
    _expect_repeatable(period)
    work = _Differences(period, _candidates(period, signals))
    return work.model(opened, tuple(_held(period)))


def _expect_repeatable(period: Period) -> None:
    """Raise if a second run from the snapshot ends otherwise, and name the block."""
    memory = period.bound.memory
    period.run()
    first = memory.snapshot(0)
    period.run()
    second = memory.snapshot(0)
    for region, one, two in (
        (memory.bus, first.bus, second.bus), (memory.state, first.state, second.state),
    ):  # fmt: skip
        different = np.frombuffer(one, np.uint8) != np.frombuffer(two, np.uint8)
        if different.any():
            names = {name for name in region.layout.slots if _touched(region, name, different)}
            order = period.bound.graph.order
            block = next(p for p in order if any(n.rsplit(".", 2)[0] == p for n in names))
            raise AloftError(
                f"block '{block}' does not repeat itself from a snapshot: it keeps something outside its "
                "declared state, so the graph cannot be differentiated; declare it as State, or write "
                "it in save_state and read it in load_state"
            )


def _touched(region: Region, name: str, different: Flags) -> bool:
    slot = region.layout.slots[name]
    size = region.sections[slot.section].dtype.itemsize
    first = region.layout.offsets[slot.section] + slot.start * size
    return bool(different[first : first + slot.size * size].any())


def _candidates(period: Period, signals: Mapping[str, RecordedField]) -> list[Coordinates]:
    """Return all candidates for state: the declared one, and the outputs that the next period reads."""
    bound = period.bound
    declared = list(state_coordinates(bound))
    state = bound.memory.state

    def ends() -> list[Array]:
        return [*_end(period, declared), *(each.copy() for each in period.observed)]

    period.run()
    nominal, found = ends(), list(declared)

    def reads(group: Sequence[Coordinates]) -> bool:
        period.run(lambda: _probe(group, state))
        return any((a != b).any() for a, b in zip(ends(), nominal, strict=True))

    groups = [list(bus_coordinates(bound, dict(signals)))]
    while groups:
        group = groups.pop()
        if not group or not reads(group):
            continue
        if len(group) == 1:
            found += group
        else:
            groups += [group[len(group) // 2 :], group[: len(group) // 2]]
    return found


def _end(period: Period, coordinates: Iterable[Coordinates]) -> list[Array]:
    return [each.read(period.bound.memory.state) for each in coordinates]


def _probe(group: Sequence[Coordinates], state: Region) -> None:
    """Displace all elements a little, to see what follows."""
    for each in group:
        values = each.read(state)
        signs = np.where(np.arange(len(values)) % 2, -1.0, 1.0)
        each.write(state, values + PROBE * signs * np.maximum(1.0, np.abs(values)))


def _held(period: Period) -> Iterable[Held]:
    """Yield the blocks between inputs and outputs that have more than floats."""
    graph = period.bound.graph
    readers: dict[str, list[str]] = {spec.path: [] for spec in graph.blocks}
    for spec in graph.blocks:
        for wire in spec.wires.values():
            readers[wire.source.rpartition(".")[0]].append(spec.path)
    sources = {path: [p for p in readers if path in readers[p]] for path in readers}
    ahead = _reached(readers, [p for each in period.inputs for p in readers[each.block]])
    behind = _reached(sources, [each.block for each in period.outputs])
    for spec in graph.blocks:
        if spec.path not in ahead or spec.path not in behind:
            continue
        kind = spec.block_type
        if issubclass(kind, BackgroundBlock):
            yield Held(spec.path, "works in the background: its outputs stay as they are")
            continue
        rings = [
            f.ring if "." in f.ring else f"{s}.{f.ring}"
            for s, port in kind.states.items() for f in port.signal.fields.values() if f.ring
        ]  # fmt: skip
        discrete = [
            f"{name}.{f.name}"
            for ports in (kind.states, kind.outputs)
            for name, port in ports.items()
            for f in port.signal.fields.values()
            if f.dtype_name != "float64" and not f.ring and f"{name}.{f.name}" not in rings
        ]
        if discrete:
            shown = ", ".join(discrete[:4]) + (", ..." if len(discrete) > 4 else "")
            yield Held(spec.path, f"discrete, stays as in the undisturbed run: {shown}")


def _reached(edges: Mapping[str, Sequence[str]], start: Iterable[str]) -> dict[str, None]:
    found: dict[str, None] = {}
    pending = list(start)
    while pending:
        path = pending.pop()
        if path not in found:
            found[path] = None
            pending += edges[path]
    return found


class _Differences:
    """Differentiates a period in the coordinates that matter."""

    def __init__(self, period: Period, candidates: Sequence[Coordinates]) -> None:
        self.period = period
        self.state = period.bound.memory.state
        self.total = sum(map(len, candidates))
        period.run()
        self._steps = [period.samples(each) for each in period.outputs]
        self._select(candidates)
        period.run(self._note_start)
        self.end = _end(period, self.kept)
        self.seen = self._observed()

    def _note_start(self) -> None:
        self.start = _end(self.period, self.kept)

    def _observed(self) -> list[Array]:
        return [
            observed[steps].copy()
            for observed, steps in zip(self.period.observed, self._steps, strict=True)
        ]

    def _select(self, candidates: Sequence[Coordinates]) -> None:
        """Keep the fields that an input reaches and that reach an output."""
        period, state = self.period, self.state
        end, seen = _end(period, candidates), self._observed()

        def changed() -> tuple[list[int], bool]:
            now = _end(period, candidates)
            rows = [k for k, (a, b) in enumerate(zip(now, end, strict=True)) if (a != b).any()]
            watched = any((a != b).any() for a, b in zip(self._observed(), seen, strict=True))
            return rows, watched

        from_inputs: dict[int, None] = {}
        for displacement in period.displacement:
            displacement[:] = PROBE
            period.run()
            displacement[:] = 0.0
            from_inputs.update(dict.fromkeys(changed()[0]))
        affects: dict[int, list[int]] = {}
        watched: dict[int, None] = {}
        pending = list(from_inputs)
        while pending:
            k = pending.pop()
            if k in affects:
                continue
            period.run(partial(_probe, [candidates[k]], state))
            affects[k], sees = changed()
            if sees:
                watched[k] = None
            pending += affects[k]
        sources: dict[str, list[str]] = {str(k): [] for k in affects}
        for k, targets in affects.items():
            for target in targets:
                sources[str(target)].append(str(k))
        seen_by_output = _reached(sources, [str(k) for k in watched])
        self.kept = [candidates[k] for k in sorted(affects) if str(k) in seen_by_output]

    def _difference(self) -> Array:
        """Return the end of the last run relative to that of the undisturbed one: states, then outputs."""
        found = [
            each.difference(now, was)
            for each, now, was in zip(
                self.kept, _end(self.period, self.kept), self.end, strict=True
            )
        ]
        for each, now, was in zip(self.period.outputs, self._observed(), self.seen, strict=True):
            found += [each.difference(a, b) for a, b in zip(now, was, strict=True)]
        return np.concatenate(found) if found else np.zeros(0)

    def _column(self, column: _Column) -> tuple[Array, float]:
        """Return a derivative, and its relative error."""
        best, error = np.zeros(0), np.inf
        for factor in FACTORS:
            h = STEP * factor * column.scale
            ahead = column.slope if factor == 1.0 else self._slope(column, h)
            slopes = [ahead, *(self._slope(column, step) for step in (-h, 2.0 * h, -2.0 * h))]
            near, far = 0.5 * (slopes[0] + slopes[1]), 0.5 * (slopes[2] + slopes[3])
            size = float(np.abs(near).max(initial=0.0)) or 1.0
            wrong = float(np.abs(near - far).max(initial=0.0)) / size
            kink = float(np.abs(slopes[0] - slopes[1]).max(initial=0.0)) / size
            wrong = max(wrong, kink if kink > KINK else 0.0)
            if wrong < error:
                best, error = (4.0 * near - far) / 3.0, wrong
            if error <= TOLERANCE:
                break
        return best, error

    def _slope(self, column: _Column, step: float) -> Array:
        column.run(step)
        return self._difference() / step

    def _columns(self) -> Iterator[_Column]:
        """Yield the states, and then the inputs in each tick in which they are written."""
        period = self.period
        for each, start in zip(self.kept, self.start, strict=True):
            for k, label in enumerate(each.labels):
                size = 1.0 if each.quaternion else max(1.0, abs(float(start[k])))
                value = 0.0 if each.quaternion else float(start[k])

                def move(
                    step: float, each: Coordinates = each, start: Array = start, k: int = k
                ) -> None:
                    period.run(lambda: each.write(self.state, each.displaced(start, k, step)))

                yield _Column(label, each.units[k], move, size, value)
        for each, displacement in zip(period.inputs, period.displacement, strict=True):
            steps = period.samples(each)
            for tick in steps:
                for k, label in enumerate(each.labels):

                    def add(
                        step: float, moved: Array = displacement, tick: int = tick, k: int = k
                    ) -> None:
                        moved[tick, k] = step
                        period.run()
                        moved[tick, k] = 0.0

                    name = label if len(steps) == 1 else f"{label}@{tick}"
                    yield _Column(name, each.units[k], add, 1.0, tick=tick)

    def model(self, opened: bool, held: tuple[Held, ...]) -> Linearisation:
        """Return the whole model, without the states that are not used."""
        period = self.period
        columns = list(self._columns())
        n = sum(map(len, self.kept))
        for column in columns:
            column.slope = self._slope(column, STEP * column.scale)
        whole = np.array([column.slope for column in columns]).T
        used = _used(whole[:n, :n], whole[:n, n:], whole[n:, :n])
        rows = [*used, *range(n, len(whole))]
        columns = [columns[k] for k in (*used, *range(n, len(columns)))]
        whole, uncertain = np.zeros((len(rows), len(columns))), {}
        for k, column in enumerate(columns):
            derivative, error = self._column(column)
            whole[:, k] = derivative[rows]
            if error > KINK:
                uncertain[column.name] = error
        n = len(used)
        states, inputs = columns[:n], columns[n:]
        output_names: list[str] = []
        output_units: list[str] = []
        output_ticks: list[int] = []
        for each, steps in zip(period.outputs, self._steps, strict=True):
            for tick in steps:
                output_names += [n if len(steps) == 1 else f"{n}@{tick}" for n in each.labels]
                output_units += each.units
                output_ticks += [tick] * len(each)
        graph = period.bound.graph
        return Linearisation(
            whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:],
            tuple(c.name for c in states), tuple(c.name for c in inputs), tuple(output_names),
            tuple(c.unit for c in states), tuple(c.unit for c in inputs), tuple(output_units),
            np.array([c.value for c in states]), period.start.tick,
            period.ticks * graph.base_period, period.ticks, graph.base_period, held, uncertain,
            self.total - n, opened, tuple(c.tick for c in inputs), tuple(output_ticks),
        )  # fmt: skip


@dataclass
class _Column:
    """A state or an input, how the period runs with it displaced, and the slope of the first step."""

    name: str
    unit: str
    run: Callable[[float], None]
    scale: float
    value: float = 0.0
    tick: int = 0
    slope: Array = field(default_factory=lambda: np.zeros(0))


def _used(a: Array, b: Array, c: Array) -> list[int]:
    """Return the states that inputs reach and that reach outputs."""
    forward, backward = (b != 0.0).any(axis=1), (c != 0.0).any(axis=0)
    for _ in range(len(a)):
        ahead = forward | ((a != 0.0) & forward).any(axis=1)
        behind = backward | ((a != 0.0).T & backward).any(axis=1)
        if (ahead == forward).all() and (behind == backward).all():
            break
        forward, backward = ahead, behind
    return np.flatnonzero(forward & backward).tolist()


def _groups(names: Sequence[str]) -> dict[str, list[int]]:
    """Return the places of each signal's samples in a period."""
    found: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        found.setdefault(name.partition("@")[0], []).append(k)
    return found


def _control_names(names: Sequence[str]) -> list[str]:
    """Return the names as python-control takes them: without dots."""
    return [name.replace(".", "/") for name in names]
