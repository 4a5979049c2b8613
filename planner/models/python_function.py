"""Functions of Python that CasADi calls."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from ...mathematics.arrays import Array

Compute = Callable[[Sequence[Array]], Sequence[Array]]
"""Computes the entries of the results from those of the arguments, which it must not keep."""


def python_function(
    name: str, given: Mapping[str, Any], found: Mapping[str, Any], compute: Compute
) -> Any:
    """Return a function of CasADi. It must be kept as long as any expression of it: CasADi keeps no object of Python.

    Args:
        name: of the function.
        given, found: names of the arguments and results, and the ``Sparsity`` of each.
        compute: called by one thread at a time, so its results may lie in memory of its own.
    """
    return _callback()(name, given, found, compute)


@cache
def _callback() -> Any:
    """Return the class, which needs CasADi to be defined."""
    import casadi as ca

    class PythonFunction(ca.Callback):
        def __init__(
            self, name: str, given: Mapping[str, Any], found: Mapping[str, Any], compute: Compute
        ) -> None:
            ca.Callback.__init__(self)
            self._given, self._found, self._compute = (
                list(given.items()),
                list(found.items()),
                compute,
            )
            self._zeros = [np.zeros(sparsity.nnz()) for sparsity in given.values()]
            self._lock = threading.Lock()
            self.construct(name, {})

        def get_n_in(self) -> int:
            return len(self._given)

        def get_n_out(self) -> int:
            return len(self._found)

        def get_name_in(self, number: int) -> str:
            return self._given[number][0]

        def get_name_out(self, number: int) -> str:
            return self._found[number][0]

        def get_sparsity_in(self, number: int) -> Any:
            return self._given[number][1]

        def get_sparsity_out(self, number: int) -> Any:
            return self._found[number][1]

        def has_eval_buffer(self) -> bool:
            return True

        def eval_buffer(self, arguments: Any, results: Any) -> int:
            """Compute the results that CasADi asks for; arguments of zeros may be missing."""
            values = [
                zeros if given is None else np.frombuffer(given)
                for zeros, given in zip(self._zeros, arguments, strict=True)
            ]
            with self._lock:  # CasADi gives the interpreter's lock back, so another thread may call
                for own, wanted in zip(self._compute(values), results, strict=True):
                    if wanted is not None:
                        np.frombuffer(wanted)[:] = own
            return 0

    return PythonFunction
