"""Operating points of a graph: values of free states and signals at which chosen conditions hold.

The unknowns p are elements of the declared state and of opened wires; the conditions are residuals r(p),
which a least-squares search with bounds brings to zero (trust region reflective: Branch, Coleman and Li, A
Subspace, Interior and Conjugate Gradient Method for Large-Scale Bound-Constrained Minimization Problems, SIAM J. Sci. Comput.
21, 1999). A free state has to stay where it is over one period of all rates; its residual is its rate.

Before the period that is judged come some in which the chosen states are put back again and again, so that what
follows from them (delays, filters, what slower blocks hold) has come to rest.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from ...logs.file.header import recorded_signals
from ...mathematics.arrays import Array
from ...runtime.graph import Graph, load
from ...runtime.language.errors import AloftError, UnitError
from ...runtime.language.units import parse_quantity
from ...runtime.running.snapshot import Snapshot
from ...runtime.running.stepping import SteppedRun
from .coordinates import Coordinates, signal_coordinates, state_coordinates
from .instant import bound_graph, go_to
from .period import Period

SETTLE = 4
"""Periods before the one that is judged."""
TOLERANCE = 1e-6
"""A condition holds when its residual is no larger, relative to the larger of 1 and what is wanted."""
STEP = 1e-6
"""The step of the differences, relative to the larger of 1 and the value."""
MOST_STEPS, PORTION_STEPS = 40, 15
"""Greatest numbers of steps: of a search, and of one behind a portion of the way."""
SINGULAR = 1e-6
"""Singular values below this share of the largest do not count."""
PORTION, LEAST_PORTION = 0.125, 1.0 / 64.0
"""The portions of the way in which states are moved to where they are wanted."""

_CONDITION = re.compile(r"\s*(?P<name>[^=<>]+?)\s*(?P<sign>==|<=|>=)\s*(?P<value>[^=<>]+?)\s*$")
_FREE = re.compile(r"\s*(?P<name>[^=]+?)\s*=\s*(?P<low>[^:=]+):(?P<high>[^:=]+?)\s*$")


@dataclass(frozen=True)
class Condition:
    """One condition at the operating point.

    Attributes:
        name: the state or signal, with its element.
        kind: ``at rest``, or the sign with what is wanted.
        residual: by how much it does not hold: of a state at rest its rate.
        unit: of the residual.
        holds: whether that is within the tolerance.
    """

    name: str
    kind: str
    residual: float
    unit: str
    holds: bool


@dataclass(frozen=True)
class Trim:
    """An operating point, or the nearest that was found.

    Attributes:
        values: of everything that is free, by name; orientations relative to the instant.
        units: of the values.
        conditions: all, each with what is left of it.
        at_bound: what is free and came to lie at a bound.
        idle: what is free and changes no condition, such as a command that takes effect later than
            the periods that are run.
        settings: overrides of the constants that write free signals.
        tick: the instant from which the search began.
        evaluations: how often the graph was run.
    """

    values: Mapping[str, float]
    units: Mapping[str, str]
    conditions: tuple[Condition, ...]
    at_bound: tuple[str, ...]
    idle: tuple[str, ...]
    settings: Mapping[str, list[float]]
    tick: int
    evaluations: int

    @property
    def success(self) -> bool:
        """True if all conditions hold."""
        return all(each.holds for each in self.conditions)

    @property
    def reason(self) -> str:
        """Conditions that cannot hold, and the obstacle; a short text if all hold."""
        broken = sorted((c for c in self.conditions if not c.holds), key=lambda c: -abs(c.residual))
        if not broken:
            return "all conditions hold"
        shown = [f"{c.name} {c.kind} (off by {c.residual:.3g} {c.unit})" for c in broken[:4]]
        text = f"{len(broken)} of {len(self.conditions)} conditions cannot hold: {', '.join(shown)}"
        text += ", ..." if len(broken) > 4 else ""
        if self.at_bound:
            text += f"; at a bound: {', '.join(self.at_bound)}"
        if self.idle:
            text += (
                f"; no condition depends on {', '.join(self.idle)} within the periods that are run"
            )
        return text

    def as_data(self) -> dict[str, Any]:
        """Return all fields as plain data."""
        return {
            "success": self.success, "reason": self.reason, "tick": self.tick,
            "values": dict(self.values), "units": dict(self.units),
            "conditions": [vars(each) for each in self.conditions], "at_bound": list(self.at_bound),
            "idle": list(self.idle), "settings": dict(self.settings), "evaluations": self.evaluations,
        }  # fmt: skip


def trim(
    graph: Graph | SteppedRun | str | Path,
    *,
    free: str | Sequence[str],
    hold: str | Sequence[str] = (),
    at: float | None = None,
    when: str = "",
    settle: int = SETTLE,
    tolerance: float = TOLERANCE,
) -> Trim:
    """Find an operating point.

    Args:
        graph: a graph or its file, which is run up to the instant, or a run that has come to it. A run
            is left in the operating point, or where it was if there is none.
        free: the unknowns: states such as ``x.x.value`` or ``robot.*.position``, each of which must stay
            where it is, and signals such as ``pd.command.torque[*]``, whose wires are opened: what
            else the port has stays as it is. Bounds stand behind: ``motor.y=0 N m:2 N m``.
        hold: conditions on signals, ``truth.position[2] == 0.3 m`` or ``motor.y <= 2``, and on states,
            ``robot.*.velocity == 0``, which then have this value and must keep it.
        at: the instant from which the search starts [s]; by default the first tick.
        when: a condition such as ``phase.phase == STAND``; the first instant at which it holds.
        settle: periods before the one that is judged, in which states are put back.
        tolerance: for residuals, relative to the larger of 1 and what is wanted.

    Raises:
        AloftError: a name, a condition or a bound cannot be read, or a block failed.
        RunError: a block failed on the way to the instant.
    """
    frees = [free] if isinstance(free, str) else list(free)
    holds = [hold] if isinstance(hold, str) else list(hold)
    if isinstance(graph, SteppedRun):
        go_to(graph, at, when)
        before = graph.snapshot()
        try:
            found = _Search(graph, frees, holds, settle, tolerance).solve()
        except BaseException:
            graph.restore(before)
            raise
        if not found.success:
            graph.restore(before)
        return found
    loaded = graph if isinstance(graph, Graph) else load(graph)
    with loaded.open() as run:
        return trim(
            run, free=frees, hold=holds, at=at, when=when, settle=settle, tolerance=tolerance
        )


@dataclass
class _Block:
    """Some unknowns, or states that are set: elements of one field."""

    where: Coordinates
    chosen: list[int]
    low: Array
    high: Array
    start: Array
    base: Array
    value_before: Array = field(default_factory=lambda: np.zeros(0))

    def set(self, state: Any, values: Array) -> None:
        """Write the chosen elements of a state into memory; the others stay as they are."""
        now = self._coordinates(state)
        now[self.chosen] = values
        self.where.write(state, self.where.moved(self.base, now) if self.where.quaternion else now)

    def value(self, state: Any) -> Array:
        """Return the chosen elements in memory; of an orientation relative to the instant."""
        return self._coordinates(state)[self.chosen]

    def _coordinates(self, state: Any) -> Array:
        now = self.where.read(state)
        return self.where.difference(now, self.base) if self.where.quaternion else now

    def names(self) -> list[str]:
        return [self.where.labels[k] for k in self.chosen]

    def units(self) -> list[str]:
        return [self.where.units[k] for k in self.chosen]


@dataclass
class _Wanted:
    """A condition on a signal."""

    name: str
    unit: str
    output: int
    element: int
    sign: str
    value: float

    def residual(self, seen: float) -> float:
        off = seen - self.value
        return off if self.sign == "==" else min(off, 0.0) if self.sign == ">=" else max(off, 0.0)


class _Search:
    """The unknowns and conditions of one search."""

    def __init__(
        self, run: SteppedRun, frees: Sequence[str], holds: Sequence[str], settle: int, tolerance: float
    ) -> None:  # fmt: skip
        self.bound, self.settle, self.tolerance = bound_graph(run), settle, tolerance
        self.evaluations = 0
        self._fields = {each.name: each for each in recorded_signals(self.bound)}
        self._states = list(state_coordinates(self.bound))
        self.free: list[_Block] = []  # states
        self.opened: list[_Block] = []
        self.fixed: list[_Block] = []
        self.wanted: list[_Wanted] = []
        outputs: list[Coordinates] = []
        for text in holds:
            self._read_condition(text, outputs)
        for text in frees:
            self._read_free(text)
        if not self.free and not self.opened:
            raise AloftError("nothing is free: name states or signals whose values are searched")
        if not self.free and not self.fixed and not self.wanted:
            raise AloftError(
                "nothing is asked for: give conditions, or free states, which come to rest"
            )
        where = [block.where for block in self.opened]
        self.period = Period(self.bound, where, outputs, held=True, only=self._needed(outputs))
        self.instant: Snapshot = self.period.start
        self._nominal = [
            self.bound.memory.bus.sections["float64"][b.where.places].copy() for b in self.opened
        ]
        for block, nominal in zip(self.opened, self._nominal, strict=True):
            block.start = nominal
        self._check_bounds()

    def _needed(self, outputs: Sequence[Coordinates]) -> set[str]:
        """Return the blocks on which conditions depend, up to the opened wires."""
        opened = {block.where.name.rpartition(".")[0] for block in self.opened}
        pending = [each.block for each in outputs if each.name.rpartition(".")[0] not in opened]
        pending += [block.where.block for block in (*self.free, *self.fixed)]
        found: set[str] = set()
        while pending:
            path = pending.pop()
            if path not in found:
                found.add(path)
                wires = self.bound.graph.block(path).wires.values()
                pending += [w.source.rpartition(".")[0] for w in wires if w.source not in opened]
        return found

    def _read_free(self, text: str) -> None:
        match = _FREE.match(text)
        name = match["name"] if match else text.strip()
        taken = {label for block in (*self.fixed, *self.free) for label in block.names()}
        found = self._matching(name)
        for where, chosen in found:
            left = [k for k in chosen if where.labels[k] not in taken]
            if left:
                self.free.append(self._block(where, left, match))
        if not found:
            where = self._signal(name, "free")
            self.opened.append(self._block(where, list(range(len(where))), match))

    def _read_condition(self, text: str, outputs: list[Coordinates]) -> None:
        match = _CONDITION.match(text)
        if match is None:
            raise AloftError(
                f"{text!r} is no condition; write block.port.field == value, or <=, >="
            )
        name, sign = match["name"], match["sign"]
        found = self._matching(name)
        if found and sign != "==":
            raise AloftError(
                f"{text!r}: {name} is a state; set it with ==, or free it within bounds"
            )
        for where, chosen in found:
            value = np.array([_number(match["value"], where.units[k], text) for k in chosen])
            block = _Block(where, chosen, value, value, value, where.read(self.bound.memory.state))
            block.value_before = block.value(self.bound.memory.state)
            self.fixed.append(block)
        if not found:
            where = self._signal(name, "held")
            outputs.append(where)
            for k, (label, unit) in enumerate(zip(where.labels, where.units, strict=True)):
                value_here = _number(match["value"], unit, text)
                self.wanted.append(_Wanted(label, unit, len(outputs) - 1, k, sign, value_here))

    def _matching(self, name: str) -> list[tuple[Coordinates, list[int]]]:
        """Return the elements of state of this name; an asterisk stands for any text without a dot.

        The entries of delays follow from what is delayed.
        """
        pattern = re.compile(re.escape(name).replace(r"\*", "[^.]*"))
        found = []
        for each in self._states:
            if each.ring is not None:
                continue
            whole = pattern.fullmatch(each.name) is not None
            chosen = [k for k, label in enumerate(each.labels) if whole or pattern.fullmatch(label)]
            if chosen:
                found.append((each, chosen))
        return found

    def _signal(self, name: str, what: str) -> Coordinates:
        try:
            found = signal_coordinates(self.bound, self._fields, name)
        except AloftError as error:
            states = [label for each in self._states for label in each.labels]
            near = ", ".join(get_close_matches(name, states, 3, 0.0))
            raise AloftError(f"{error}; nor is it a state: there is {near}") from error
        if found.quaternion:
            raise AloftError(
                f"{name} is an orientation, which cannot be {what} as a signal; name its state"
            )
        return found

    def _block(self, where: Coordinates, chosen: list[int], match: re.Match[str] | None) -> _Block:
        low, high = np.full(len(chosen), -np.inf), np.full(len(chosen), np.inf)
        if match is not None:
            for i, k in enumerate(chosen):
                low[i] = _number(match["low"], where.units[k], match[0])
                high[i] = _number(match["high"], where.units[k], match[0])
                if low[i] >= high[i]:
                    raise AloftError(f"{match[0]!r}: the lower bound is not below the upper one")
        base = where.read(self.bound.memory.state)
        start = np.zeros(len(chosen)) if where.quaternion else base[chosen]
        return _Block(where, chosen, low, high, start, base)

    def _check_bounds(self) -> None:
        names = [name for block in (*self.free, *self.opened) for name in block.names()]
        double = [name for k, name in enumerate(names) if name in names[:k]]
        if double:
            raise AloftError(f"{double[0]} is free twice")

    def _parts(self, unknowns: Array) -> tuple[list[Array], list[Array]]:
        sizes = [len(block.chosen) for block in (*self.free, *self.opened)]
        parts = np.split(unknowns, np.cumsum(sizes)[:-1])
        return parts[: len(self.free)], parts[len(self.free) :]

    def residuals(self, unknowns: Array) -> Array:
        """Return the residual of every condition: states at rest, states that are held, signals."""
        self.evaluations += 1
        period, state = self.period, self.bound.memory.state
        states, signals = self._parts(unknowns)
        for displacement, nominal, value in zip(
            period.displacement, self._nominal, signals, strict=True
        ):
            displacement[:] = value - nominal

        def put_back() -> None:
            for block in self.fixed:
                block.set(state, block.start)
            for block, values in zip(self.free, states, strict=True):
                block.set(state, values)

        try:
            for _ in range(self.settle):
                period.run(put_back)
                period.start = self.bound.memory.snapshot(self.bound.clock.tick)
            period.run(put_back)
        finally:
            period.start = self.instant
        time = period.ticks * self.bound.graph.base_period
        found = [
            (block.value(state) - values) / time
            for block, values in zip(self.free, states, strict=True)
        ]
        found += [(block.value(state) - block.start) / time for block in self.fixed]
        found.append(
            np.array([w.residual(period.observed[w.output][-1, w.element]) for w in self.wanted])
        )
        return np.concatenate(found)

    def jacobian(self, unknowns: Array) -> Array:
        """Compute the Jacobian by central differences."""
        columns = []
        for k, value in enumerate(unknowns):
            step = np.zeros(len(unknowns))
            step[k] = STEP * max(1.0, abs(value))
            ahead, behind = self.residuals(unknowns + step), self.residuals(unknowns - step)
            columns.append((ahead - behind) / (2.0 * step[k]))
        return np.array(columns).T

    def _hold(self, left: Array) -> bool:
        return all(each.holds for each in self._conditions(left))

    def _moved(self, start: Array, low: Array, high: Array) -> Array:
        """Return a start for states that are set elsewhere than they are: the unknowns follow along the tangent.

        Set at once, a lower base would press its feet deep into the ground. Rates are set at once. A portion of
        the way after which the conditions cannot be brought to hold is halved.
        """
        wanted = [block.start for block in self.fixed]
        way = [
            np.where(
                [unit.endswith("/s") for unit in block.units()], 0.0, value - block.value_before
            )
            for value, block in zip(wanted, self.fixed, strict=True)
        ]

        def go(share: float) -> None:
            for block, value, step in zip(self.fixed, wanted, way, strict=True):
                block.start = value - (1.0 - share) * step

        go(0.0)
        found, share, portion = self._least_squares(start, low, high), 0.0, PORTION
        while share < 1.0 and portion >= LEAST_PORTION and self._hold(found.fun):
            go(share + STEP)
            slope = (self.residuals(found.x) - found.fun) / STEP
            go(share)
            along = np.linalg.lstsq(self.jacobian(found.x), slope, rcond=SINGULAR)[0]
            while portion >= LEAST_PORTION:
                portion = min(portion, 1.0 - share)
                go(share + portion)
                ahead = np.clip(found.x - along * portion, low, high)
                done = self._least_squares(ahead, low, high, PORTION_STEPS)
                if self._hold(done.fun):
                    found, share = done, share + portion
                    break
                portion *= 0.5
        go(1.0)
        return np.asarray(found.x)

    def _least_squares(self, start: Array, low: Array, high: Array, steps: int = MOST_STEPS) -> Any:
        from scipy.optimize import least_squares

        def stop(intermediate_result: Any) -> None:
            if self._hold(intermediate_result.fun):
                raise StopIteration

        return least_squares(
            self.residuals, start, self.jacobian, (low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12,
            max_nfev=steps, callback=stop,
        )  # fmt: skip

    def solve(self) -> Trim:
        """Search from the instant."""
        blocks = (*self.free, *self.opened)
        low = np.concatenate([block.low for block in blocks])
        high = np.concatenate([block.high for block in blocks])
        start = np.clip(np.concatenate([block.start for block in blocks]), low, high)
        influence = np.abs(self.jacobian(start)).max(axis=0, initial=0.0)
        if self.fixed:
            start = self._moved(start, low, high)
        done = self._least_squares(start, low, high)
        left = self.residuals(done.x)  # leaves the memory in the operating point
        names = [name for block in blocks for name in block.names()]
        units = [unit for block in blocks for unit in block.units()]
        return Trim(
            dict(zip(names, done.x.tolist(), strict=True)), dict(zip(names, units, strict=True)),
            tuple(self._conditions(left)),
            tuple(name for name, active in zip(names, done.active_mask, strict=True) if active),
            tuple(name for name, size in zip(names, influence, strict=True) if size == 0.0),
            self._settings(done.x), self.instant.tick, self.evaluations,
        )  # fmt: skip

    def _conditions(self, left: Array) -> list[Condition]:
        found: list[tuple[str, str, str, float]] = []
        for block in self.free:
            found += [
                (n, "at rest", _rate(u), 0.0)
                for n, u in zip(block.names(), block.units(), strict=True)
            ]
        for block in self.fixed:
            for name, unit, value in zip(block.names(), block.units(), block.start, strict=True):
                found.append((name, f"stays at {value:g} {unit}".rstrip(), _rate(unit), 0.0))
        for each in self.wanted:
            text = f"{each.sign} {each.value:g} {each.unit}".rstrip()
            found.append((each.name, text, each.unit, each.value))
        return [
            Condition(name, kind, float(residual), unit, abs(residual) <= self.tolerance * max(1.0, abs(value)))
            for (name, kind, unit, value), residual in zip(found, left.tolist(), strict=True)
        ]  # fmt: skip

    def _settings(self, unknowns: Array) -> dict[str, list[float]]:
        """Return the overrides by which constants write what was found."""
        found = {}
        for block, values in zip(self.opened, self._parts(unknowns)[1], strict=True):
            kind = self.bound.blocks[block.where.block]
            if type(kind).__name__ == "Constant":
                whole = np.array(kind.params.value, np.float64)  # type: ignore[attr-defined]  # of blocks.Constant
                slot = self.bound.memory.bus.layout.slots[f"{block.where.block}.y.value"]
                whole[block.where.places - slot.start] = values
                found[f"{block.where.block}.value"] = whole.tolist()
        return found


def _number(text: str, unit: str, whole: str) -> float:
    """Return a number, perhaps with its unit. Raises ``AloftError``."""
    try:
        return parse_quantity(text.strip(), unit)
    except UnitError as error:
        raise AloftError(f"{whole.strip()!r}: {error}") from error


def _rate(unit: str) -> str:
    """Return the unit of a rate."""
    return f"{unit}/s" if unit else "1/s"
