"""Methods of dataclasses are made when they are first called: a start imports two hundred and uses few.

Up to Python 3.12 a dataclass makes each of its six methods by ``exec``, a tenth of the time of a check. From 3.13 on
it is one for all, and nothing is changed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

NAMES = frozenset(("__init__", "__repr__", "__eq__", "__hash__", "__setattr__", "__delattr__"))


def make_when_called() -> None:
    """Let the dataclasses of this process that follow make their methods when they are first called."""
    at_once: Callable[..., Any] | None = getattr(dataclasses, "_create_fn", None)
    if at_once is None or hasattr(at_once, "made_when_called"):
        return

    def later(name: str, *definition: Any, **scope: Any) -> Any:
        if name not in NAMES:
            return at_once(name, *definition, **scope)
        made: list[Any] = []

        def method(self: Any, *arguments: Any, **named: Any) -> Any:
            if not made:
                made.append(at_once(name, *definition, **scope))
                made[0].__qualname__ = method.__qualname__
                for owner in type(self).__mro__:
                    if vars(owner).get(name) is method:
                        setattr(owner, name, made[0])
            return made[0](self, *arguments, **named)

        method.__name__ = name
        return method

    later.made_when_called = True  # type: ignore[attr-defined]
    dataclasses._create_fn = later  # type: ignore[attr-defined]
