"""Dataclasses whose methods are made when they are first called are as others are."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

BOTH = """
import dataclasses, json, sys
from dataclasses import dataclass, field
if sys.argv[1] == "later":
    from aloft.processes.quick_imports import make_when_called
    make_when_called()
    make_when_called()

@dataclass(frozen=True)
class Base:
    a: int
    b: list[int] = field(default_factory=list, compare=False)

@dataclass(frozen=True)
class Special(Base):
    c: float = 2.0
    def __post_init__(self):
        object.__setattr__(self, "a", self.a + 1)

@dataclass(order=True)
class Open:
    x: int = 0

def said(call):
    try:
        return repr(call())
    except Exception as error:
        return f"{type(error).__name__}: {error}"

one, two = Special(1), Special(1, [2], c=2.0)
print(json.dumps([
    said(lambda: one), said(lambda: one == two), said(lambda: hash(one) == hash(two)),
    said(lambda: Base(3)), said(lambda: Base(2) == one), said(lambda: Special()),
    said(lambda: Special(1, d=2)), said(lambda: setattr(one, "a", 5)), said(lambda: delattr(one, "c")),
    said(lambda: dataclasses.replace(one, c=3.0)), said(lambda: dataclasses.asdict(two)),
    said(lambda: Open(1) < Open(2)), said(lambda: hash(Open())), said(lambda: Open(4) != Open()),
    Special.__init__.__qualname__, said(lambda: one.b is Special(1).b),
]))
"""


def said(how: str) -> list[str]:
    """What the methods of three dataclasses return and raise, made at once or later."""
    done = subprocess.run([sys.executable, "-c", BOTH, how], capture_output=True, text=True, check=True)  # fmt: skip
    found: list[str] = json.loads(done.stdout)
    return found


@pytest.mark.skipif(sys.version_info >= (3, 13), reason="one for all methods there")
def test_they_return_and_raise_the_same() -> None:
    later, at_once = said("later"), said("at once")
    assert later == at_once
    assert at_once[0] == "Special(a=2, b=[], c=2.0)"
