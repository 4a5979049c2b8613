"""Object files are placed in memory without LLVM, and what is not known is left to it."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.mathematics.compiling import machine_code, object_file
from aloft.mathematics.compiling.arguments import pack, type_of
from aloft.mathematics.compiling.machine_code import ENTRY, MachineCode
from aloft.mathematics.compiling.translate import Translator
from aloft.mathematics.kernel import kernel

Array = Any
WEIGHTS = np.array([0.3, -1.7, 2.9])

pytestmark = pytest.mark.skipif(
    not machine_code.process_triple().startswith("x86_64-unknown-linux"),
    reason="LLVM links elsewhere",
)


@kernel
def uses_everything(x: Array, kind: int, out: Array) -> None:
    """Constants, a table of them, memory that is set to zero, a jump by number, and an error."""
    own = np.zeros(64)
    for k in range(3):
        own[k] = WEIGHTS[k] * x[k] - 0.1
    if kind == 0:
        out[0] = own[0] + own[63]
    elif kind == 1:
        out[0] = own[1] * 7.25
    elif kind == 2:
        out[0] = own[2] / 3.5
    else:
        out[0] = own[kind % 3] // (kind - 3)


@pytest.fixture(scope="module")
def code() -> bytes:
    """The object file of the kernel."""
    signature = tuple(type_of(each) for each in (np.zeros(3), 0, np.zeros(1)))
    return Translator().object_code(uses_everything, signature)


def test_placed_code_computes_what_linked_code_does(code):
    linked = machine_code.linked(code, ENTRY, {})
    placed = object_file.place(code, ENTRY)
    assert placed is not None
    x = np.array([0.7, 1.1, -2.3])
    for kind in (0, 1, 2, 5, 9):
        made = []
        for address in (linked[ENTRY], placed.address):
            out = np.zeros(1)
            words = pack((x, kind, out))
            ctypes.PYFUNCTYPE(None, ctypes.c_size_t)(address)(words.ctypes.data)
            made.append(out.tobytes())
        assert made[0] == made[1]


def test_placed_code_reports_errors(code):
    made = MachineCode(code)
    assert isinstance(made._loaded, object_file.CodeInMemory)
    words = pack((np.zeros(3), 3, np.zeros(1)))
    with pytest.raises(ZeroDivisionError):
        made.function(ctypes.c_size_t(words.ctypes.data))


def test_placed_code_cannot_be_written(code):
    placed = object_file.place(code, ENTRY)
    pages = [line.split() for line in Path("/proc/self/maps").read_text().splitlines()]
    of_code = [
        page[1] for page in pages
        if int(page[0].split("-")[0], 16) <= placed.address < int(page[0].split("-")[1], 16)
    ]  # fmt: skip
    assert [rights[:3] for rights in of_code] == ["r-x"]


def _with_relocation(code: bytes, kind: int) -> bytes:
    """Change the type of the first relocation."""
    sections = object_file._HEADER.unpack_from(code)[6]
    count = object_file._HEADER.unpack_from(code)[12]
    for k in range(count):
        section = object_file._SECTION.unpack_from(code, sections + k * 64)
        if section[1] == 4:
            at = section[4] + 8
            return code[:at] + kind.to_bytes(4, "little") + code[at + 4 :]
    raise AssertionError("there are no relocations")


def test_what_is_not_known_is_left_to_llvm(code):
    assert object_file.place(_with_relocation(code, 10), ENTRY) is None  # R_X86_64_32
    assert object_file.place(code, "another_entry") is None
    aarch64 = code[:18] + (183).to_bytes(2, "little") + code[20:]
    assert object_file.place(aarch64, ENTRY) is None


def test_a_damaged_file_is_left_to_llvm_which_refuses_it(code):
    for cut in (0, 10, 63, len(code) // 2):
        assert object_file.place(code[:cut], ENTRY) is None
    with pytest.raises((RuntimeError, ValueError)):
        MachineCode(code[: len(code) // 2])


def test_a_system_that_lets_no_memory_become_code_links_by_llvm(code, monkeypatch):
    monkeypatch.setattr(object_file, "_protect", lambda: lambda *_: -1)
    assert object_file.place(code, ENTRY) is None
    assert MachineCode(code).address


def test_a_known_graph_runs_without_llvm(tmp_path):
    text = """
import sys, aloft
result = aloft.load('''
rate: 100 Hz
duration: 0.05 s
blocks:
  one: {use: blocks.SineWave, with: {amplitude: 1.0}}
  sum: {use: blocks.Integrator, in: {u: one.y}}
''').run()
print(result.success, "llvmlite.binding" in sys.modules)
"""
    told = [
        subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True).stdout.split()
        for _ in range(2)
    ]  # fmt: skip
    assert told[1] == ["True", "False"]
