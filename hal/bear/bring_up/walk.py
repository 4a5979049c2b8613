"""Walk through the steps: resume behind the last one that passed, stop at the first that does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from ..bus import BusError
from .session import BringUpRecord, Session, StepReport
from .steps import STEPS, BringUpStep


class UnknownStepError(LookupError):
    """There is no such step."""


def steps_from(record: BringUpRecord, first: str | None) -> tuple[BringUpStep, ...]:
    """The steps to do: from ``first``, or from the first that has not passed.

    Raises:
        UnknownStepError: there is no step of that name.
    """
    names = [step.name for step in STEPS]
    if first is not None:
        if first not in names:
            raise UnknownStepError(f"there is no step {first!r}: {', '.join(names)}")
        return STEPS[names.index(first) :]
    for k, step in enumerate(STEPS):
        if not record.passed(step.name):
            return STEPS[k:]
    return ()


def walk(
    session: Session, record: BringUpRecord, first: str | None = None,
    announce: Callable[[BringUpStep], None] = lambda step: None,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Do the steps, note each in the record, and yield its entry; the first that fails is the last."""
    for step in steps_from(record, first):
        announce(step)
        try:
            report = step.run(session)
        except BusError as error:
            report = StepReport()
            report.add("bus", "answers of all drives", str(error), "check cables; --from drives")
        yield record.add(step.name, report)
        if not report.passed:
            return
