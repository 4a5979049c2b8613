"""Failures of compiled code, which end a run, and of compiling."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Failure(IntEnum):
    """Reason for which compiled code ends a run."""

    DIVIDED_BY_ZERO = 0
    TOO_LARGE = 1
    OUT_OF_DOMAIN = 2
    OUT_OF_RANGE = 3
    WRONG_LENGTH = 4
    NUMBA = 5


FAILURES: dict[Failure, tuple[type[Exception], str]] = {
    Failure.DIVIDED_BY_ZERO: (ZeroDivisionError, "divided by zero"),
    Failure.TOO_LARGE: (OverflowError, "got a whole number that does not fit into 64 bits"),
    Failure.OUT_OF_DOMAIN: (ValueError, "called a function outside of its domain"),
    Failure.OUT_OF_RANGE: (OverflowError, "got a number beyond the largest float"),
    Failure.NUMBA: (RuntimeError, "called a numba function that raised an error"),
    Failure.WRONG_LENGTH: (
        IndexError,
        "met a slice of another length than what it is combined with",
    ),
}
"""The error that Python would raise, and what is said of the kernel."""


class CompileError(Exception):
    """A kernel cannot be compiled; the text gives kernel, place and reason."""


class Site(NamedTuple):
    """A line at which a function can fail, and why."""

    failure: Failure
    line: int


MOST_SITES = 255
"""Sites of a function that are told apart."""
