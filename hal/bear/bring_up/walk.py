"""Walk through the steps: resume behind the last one that passed, stop at the first that does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from ..bus import BusError
from .session import Journal, Outcome, Session
from .steps import STEPS, Step


class UnknownStepError(LookupError):
    """There is no such step."""


def steps_from(journal: Journal, first: str | None) -> tuple[Step, ...]:
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
        if not journal.passed(step.name):
            return STEPS[k:]
    return ()


def walk(
    session: Session, journal: Journal, first: str | None = None,
    announce: Callable[[Step], None] = lambda step: None,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Do the steps, note each in the journal, and yield its entry; the first that fails is the last."""
    for step in steps_from(journal, first):
        announce(step)
        try:
            outcome = step.run(session)
        except BusError as error:
            outcome = Outcome()
            outcome.add("bus", "answers of all drives", str(error), "check cables; --from drives")
        yield journal.add(step.name, outcome)
        if not outcome.passed:
            return
