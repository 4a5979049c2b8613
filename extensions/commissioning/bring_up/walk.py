"""Walk through the steps: resume behind the last one that passed, stop at the first that does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from ....hal.bear.bus import BusError
from .session import BringUpRecord, LetGoError, Session, StepReport
from .steps import STEPS, BringUpStep


class UnknownStepError(LookupError):
    """There is no such step."""


def steps_from(
    record: BringUpRecord, first: str | None, last: str | None = None
) -> tuple[BringUpStep, ...]:
    """Return the steps to do: from ``first``, or from the first that has not passed, to ``last``.

    Raises:
        UnknownStepError: there is no step of that name.
    """
    names = [step.name for step in STEPS]
    for name in (first, last):
        if name is not None and name not in names:
            raise UnknownStepError(f"there is no step {name!r}: {', '.join(names)}")
    end = len(STEPS) if last is None else names.index(last) + 1
    if first is not None:
        return STEPS[names.index(first) : end]
    for k, step in enumerate(STEPS):
        if not record.passed(step.name):
            return STEPS[k:end]
    return ()


def walk(
    session: Session, record: BringUpRecord, first: str | None = None, last: str | None = None,
    announce: Callable[[BringUpStep], None] = lambda step: None,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Do the steps, note each in the record, and yield its entry; the first that fails is the last."""
    for step in steps_from(record, first, last):
        announce(step)
        try:
            report = step.run(session)
        except LetGoError as error:
            report = StepReport()
            report.add("dead man's switch", "held", str(error), "hold it, and call again to go on")
        except BusError as error:
            report = StepReport()
            report.add("bus", "answers of all drives", str(error), "check cables; --first drives")
        yield record.add(step.name, report)
        if not report.passed:
            return
