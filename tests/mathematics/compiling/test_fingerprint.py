"""The name of machine code changes with everything that the code depends on, and with nothing else."""

import types

import numpy as np

from aloft.mathematics.compiling.arguments import type_of
from aloft.mathematics.compiling.fingerprint import fingerprint
from aloft.mathematics.compiling.kernel_registry import register

SOURCE = """
SCALE = {scale}

def inner(x: float) -> float:
    {comment}return {inner}

def outer(values, n):
    {doc}
    values[0] = SCALE * inner(values[n])
"""
TYPES = (type_of(np.zeros(3)), type_of(1))


def name(signature=TYPES, tools="tools", **parts):
    values = {"scale": 2.0, "inner": "x + 1.0", "comment": "", "doc": '"""One."""', **parts}
    module = types.ModuleType("some_kernels")
    exec(SOURCE.format(**values), vars(module))  # noqa: S102  # the source is the text above
    for function in ("inner", "outer"):
        register(vars(module)[function])
    return fingerprint(module.outer, signature, tools)


def test_what_counts():
    first = name()
    assert first == name()
    assert first == name(comment="# a comment\n    ", doc='"""Two."""')
    others = [
        name(inner="x + 2.0"),
        name(inner="x - 1.0"),
        name(scale=3.0),
        name(tools="other tools"),
        name(signature=(type_of(np.zeros((3, 3))), type_of(1))),
        name(signature=(type_of(np.zeros(6)[::2]), type_of(1))),
        name(signature=(type_of(np.zeros(3)), type_of(1.0))),
    ]
    assert len({first, *others}) == 1 + len(others)
