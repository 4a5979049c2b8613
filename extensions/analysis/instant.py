"""The instant of a run at which it is analysed: a time, or the first at which a condition holds."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

import numpy as np

from ...logs.file.header import recorded_signals
from ...runtime.language.errors import AloftError
from ...runtime.language.selection import Selection, select
from ...runtime.language.signal_error import CONDITION
from ...runtime.running.memory import BoundGraph
from ...runtime.running.stepping import SteppedRun


def go_to(run: SteppedRun, at: float | None, when: str) -> None:
    """Step to an instant: a time [s], the first at which a condition holds, or the first from then on.

    Raises:
        AloftError: the run does not come to it, or the condition cannot be read.
        RunError: a block failed on the way.
    """
    if at is not None:
        ticks = round(at * run.graph.base_rate) - run.tick
        if ticks < 0:
            raise AloftError(f"the run is at {run.time:g} s already, beyond {at:g} s")
        if ticks and run.step(ticks) < ticks:
            raise AloftError(f"the run ended at {run.time:g} s, before {at:g} s: {run.reason}")
    if when:
        holds = _condition(run, when)
        if run.tick == 0:
            run.step()
        while not holds():
            if not run.step():
                raise AloftError(
                    f"{when!r} never held: the run ended at {run.time:g} s: {run.reason}"
                )
    if run.tick == 0:
        run.step()  # before the first tick no signal has a value


def _condition(run: SteppedRun, text: str) -> Callable[[], bool]:
    """Return a function that evaluates a condition. Raises ``AloftError`` if it cannot be read."""
    match = CONDITION.match(text)
    bound = bound_graph(run)
    fields = {field.name: field for field in recorded_signals(bound)}
    if match is None:
        raise AloftError(f"{text!r} is no condition; write block.port.field == value")
    name, sign, value = match["name"], match["sign"], match["value"]
    base, _, index = name.partition("[")
    if base not in fields:
        same = [each for each in fields if each.rpartition(".")[0] == base]
        named = [each for each in fields if each.startswith(f"{base.rpartition('.')[0]}.") and each.endswith(f".{base.rpartition('.')[2]}")]  # fmt: skip
        found = same if len(same) == 1 else named
        if len(found) != 1:
            near = ", ".join(found or get_close_matches(base, fields, 3, 0.0))
            raise AloftError(f"there is no one signal {base!r}; there is {near}")
        base = found[0]
    declared = fields[base]
    numbers = {each: number for number, each in declared.values.items()}
    known: dict[str, float] = {"true": 1.0, "false": 0.0, **numbers}
    try:
        wanted = known[value.lower()] if value.lower() in known else float(value)
    except ValueError:
        raise AloftError(
            f"{value!r} is no value of {base}; it has {', '.join(numbers) or 'numbers'}"
        ) from None
    try:
        indices = (index.removesuffix("]"),) if index else ()
        place = select(Selection("", indices), declared.shape).reshape(-1)
    except ValueError as error:
        raise AloftError(f"{name}: {error}") from error
    if len(place) != 1:
        raise AloftError(f"{base} has {len(place)} elements; say which, as {base}[0]")
    flat = bound.memory.bus.field(base, writable=False).reshape(-1)
    compare = {"==": np.equal, "!=": np.not_equal, "<": np.less, "<=": np.less_equal,
               ">": np.greater, ">=": np.greater_equal}[sign]  # fmt: skip
    return lambda: bool(compare(flat[place[0]], wanted))


def bound_graph(run: SteppedRun) -> BoundGraph:
    """Return the bound graph of a run that is stepped."""
    return run._bound
