"""Kernels are linked once, and numba's own libraries stay complete beside them."""

import numba
import numpy as np
import pytest
from numba.core import codegen, cpu

from aloft.mathematics import rotations
from aloft.mathematics.compiling import compile_calls as module
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.compiling.linking import linked_once

pytestmark = pytest.mark.usefixtures("own_cache")


def test_numba_is_as_before_outside():
    before = codegen.JITCPUCodegen._library_class, cpu.CPUContext.get_executable
    with pytest.raises(ValueError, match="inside"), linked_once():
        assert codegen.JITCPUCodegen._library_class is not before[0]
        raise ValueError("inside")
    assert (codegen.JITCPUCodegen._library_class, cpu.CPUContext.get_executable) == before


def test_what_numba_compiled_for_a_kernel_serves_other_functions():
    """numba keeps its helpers; one that was compiled for a kernel is linked whole into others."""
    values = np.linspace(-2.0, 2.0, 12).reshape(3, 4)
    call = KernelCall(rotations.to_matrix, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros((3, 3)))
    assert module.compile_calls([call]) == ""

    @numba.njit
    def total(a):
        out = np.zeros(a.shape[0])
        for i in range(a.shape[0]):
            out[i] = np.floor(a[i, 0]) // 1.5 + abs(a[i, 1]) ** 2.5 % 0.7
        return out.sum()

    assert total(values) == pytest.approx(total.py_func(values))


def test_another_version_of_numba_keeps_its_way(monkeypatch):
    monkeypatch.delattr(codegen.JITCPUCodegen, "_library_class")
    before = cpu.CPUContext.get_executable
    with linked_once():
        assert cpu.CPUContext.get_executable is before
