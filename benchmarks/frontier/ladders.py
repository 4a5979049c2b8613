"""How far up a ladder something works, found with few tries.

Both searches are generators: they yield the rung to try, are sent whether it works, and return the
highest that does, 0 for none. So they know nothing of what a try is, and what is already known can
be answered at once.
"""

from __future__ import annotations

from collections.abc import Generator

FAILURES = 2
"""After so many rungs in a row that fail the walk goes no further."""


def furthest(start: int, most: int, good: int = 0) -> Generator[int, bool, int]:
    """The last rung before one that fails, by strides that double, and then by bisection.

    It takes for granted that the rungs up to ``good`` work, and that what fails once fails from
    there on. It begins with ``start``, in ``good`` + 1 to ``most``.
    """
    bad, stride, rung = most + 1, 1, start
    while bad - good > 1:
        works = yield rung
        if works:
            good = rung
        else:
            bad = rung
        if bad > most:
            rung = min(good + stride, most)
        elif not works and stride < bad - good:
            rung = bad - stride
        else:
            rung = (good + bad) // 2
        stride *= 2
    return good


def outward(start: int, most: int) -> Generator[int, bool, int]:
    """The highest rung that works, walking outwards from ``start`` to ``most`` one by one until
    ``FAILURES`` in a row fail; then, if none has worked, inwards to the first that does."""
    reached, failures, rung = 0, 0, start
    while rung <= most and failures < FAILURES:
        if (yield rung):
            reached, failures = rung, 0
        else:
            failures += 1
        rung += 1
    rung = start - 1
    while not reached and rung > 0:
        if (yield rung):
            reached = rung
        rung -= 1
    return reached
