"""One step of a transfer function in state space, for every element of a vector."""

from __future__ import annotations

from .arrays import Array
from .kernel import kernel


@kernel
def advance(
    a: Array, b: Array, c: Array, d: float, u: Array, states: Array, scratch: Array, out: Array
) -> None:
    """Write c x + d u into ``out`` (n), and let every row x of ``states`` (n, k) become A x + b u.

    ``a`` is (k, k), ``b`` and ``c`` are (k), ``scratch`` is (k).
    """
    for element in range(u.shape[0]):
        value = float(u[element])
        total = d * value
        for i in range(c.shape[0]):
            total += float(c[i]) * float(states[element, i])
        for i in range(c.shape[0]):
            sum_of_row = float(b[i]) * value
            for j in range(c.shape[0]):
                sum_of_row += float(a[i, j]) * float(states[element, j])
            scratch[i] = sum_of_row
        for i in range(c.shape[0]):
            states[element, i] = float(scratch[i])
        out[element] = total
