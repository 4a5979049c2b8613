"""What is printed of a run that hangs and is abandoned, before its process ends."""

from __future__ import annotations

from ...runtime.running.memory import BoundGraph
from ...runtime.running.run_result import RunResult
from ..shared.output import print_json


class LastWords:
    """A sink that prints the JSON object of an abandoned run; it records nothing.

    Args:
        name: what the graph is called.
        as_json: whether the object is printed; the reason goes to standard error in any case.
    """

    def __init__(self, name: str, as_json: bool) -> None:
        self._name = name
        self._as_json = as_json

    def open(self, bound: BoundGraph) -> None:
        """Nothing to prepare."""

    def record(self, tick: int) -> None:
        """Nothing to record."""

    def close(self) -> None:
        """Nothing to close."""

    def abandoned(self, result: RunResult) -> None:
        """Print the result."""
        if self._as_json:
            print_json({"graph": self._name, **result.to_json()})
