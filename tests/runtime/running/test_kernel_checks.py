"""Mistakes in users' kernels and in ``setup`` are mistakes of the graph: found before anything moves, with their line."""

from __future__ import annotations

from pathlib import Path

import pytest

import aloft
from aloft.extensions.export.clib.part import needs_python
from aloft.runtime.language.errors import ExitCode, RunError
from aloft.runtime.running.block_mistakes import mistakes_of, tied_to_machine
from aloft.runtime.running.memory import BoundGraph

BLOCK = '''
import numpy as np
from aloft import Block, Field, Output, Signal, kernel
from aloft.mathematics.arrays import Array1D


class V(Signal):
    """A vector."""

    v = Field(3, unit="1", text="numbers")


class {name}(Block):
    """A block."""

    y = Output(V, text="y")

    def setup(self) -> None:
        self.a = {table}

    @kernel
    @staticmethod
    def step(y: V, a: Array1D) -> None:
        {statement}
'''


def graph_of(folder: Path, name: str, statement: str, table: str) -> Path:
    (folder / f"{name.lower()}.py").write_text(
        BLOCK.format(name=name, statement=statement, table=table)
    )
    file = folder / "g.yaml"
    file.write_text(
        f'rate: 100 Hz\nduration: 1 s\nblocks:\n  b: {{use: "{name.lower()}:{name}"}}\n'
    )
    return file


@pytest.mark.parametrize(
    ("name", "statement", "table", "text", "line"),
    [
        ("Mistyped", "y.w[0] = 1.0", "np.zeros(3)", "V has no field 'w'; it has v", 24),
        ("Beyond", "y.v[0] = a[4]", "np.zeros(4)", "a[4] is beyond a: the indices of its 4 elements are -4 to 3", 24),
        ("Unequal", "y.v[:] = a", "np.zeros(4)", "a value of shape (4,) does not fit into (3,)", 24),
        ("Reaching", "y.v[:] = a[1:4]", "np.zeros(3)", "a value of shape (2,) does not fit into (3,)", 24),
        ("Single", "y.v[:] = y.v * a", "np.zeros(1)", "shapes (3,) and (1,) do not fit together; one element is repeated only where its array's declaration says that it is one: take it by its index", 24),
        ("Looping", "y.v[0] = [a[i] for i in range(9)][8]", "np.zeros(4)", "index 4 is out of bounds for axis 0", 24),
        ("Failing", "y.v[0] = a[0]", "np.zeros(3) @ np.zeros((4, 4))", "failed in setup: ValueError: matmul", 19),
    ],
)  # fmt: skip
def test_a_mistake_is_found_with_its_line(
    tmp_path: Path, name: str, statement: str, table: str, text: str, line: int
) -> None:
    checked = aloft.load(graph_of(tmp_path, name, statement, table)).checked
    found = mistakes_of(checked)["b"]
    assert text in found and f"{name.lower()}.py:{line}" in found and "g.yaml:4" in found
    with pytest.raises(RunError) as error:
        BoundGraph(checked)
    assert error.value.exit_code == ExitCode.BAD_INPUT


def test_a_right_block_passes(tmp_path: Path) -> None:
    checked = aloft.load(graph_of(tmp_path, "Right", "y.v[:] = a[::-1]", "np.ones(3)")).checked
    assert not mistakes_of(checked)
    BoundGraph(checked)


NUMBA = '''
import numba
import numpy as np
from aloft import Block, Field, Output, Signal, kernel


class V(Signal):
    """A vector."""

    v = Field(3, unit="1", text="numbers")


@numba.njit
def product(a):
    a[0] = np.dot(a, a)


class Solving(Block):
    """A block."""

    y = Output(V, text="y")

    @kernel
    @staticmethod
    def step(y: V) -> None:
        product(y.v)
'''


def test_blas_in_a_kernel_is_said(tmp_path: Path) -> None:
    (tmp_path / "solving.py").write_text(NUMBA)
    file = tmp_path / "g.yaml"
    file.write_text('rate: 100 Hz\nduration: 1 s\nblocks:\n  b: {use: "solving:Solving"}\n')
    checked = aloft.load(file).checked
    (text,) = tied_to_machine(checked)
    assert text.startswith("block 'b': numba function") and "bits depend on the machine" in text
    block = BoundGraph(checked).blocks["b"]
    (reason,) = needs_python(block)
    assert reason.endswith("solving.product, a function of Numba, which needs its runtime")
