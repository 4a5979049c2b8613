"""Lets a process start sooner: methods of dataclasses are made when first called, and Pydantic looks for no plugins.

A start imports two hundred dataclasses and uses few. Up to Python 3.12 each makes each of its six methods by ``exec``,
a tenth of the time of a check. From 3.13 on it is one for all, and nothing is changed.
"""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Callable
from types import ModuleType
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


def without_plugins() -> None:
    """Let Pydantic neither look through all installed packages for plugins, a tenth of a start, nor import what would,
    a twentieth; unless the variable of the environment says which plugins it shall have.
    """
    if os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__") == "__all__":
        none = ModuleType("pydantic.plugin._loader")
        vars(none)["get_plugins"] = tuple
        sys.modules.setdefault(none.__name__, none)
