"""What numba is asked to compile: every kernel once for each kind of arguments."""

from __future__ import annotations

import numpy as np

from aloft.mathematics.compiling.arguments import type_of
from aloft.mathematics.compiling.translate import Translator

from .kernels_for_tests import total_of_positive


def test_a_kernel_is_not_compiled_again_for_a_variable_that_begins_as_zero() -> None:
    translator = Translator()
    arguments = (np.array([1.0, -2.0, 3.0]), np.zeros(1))
    translator.object_code(total_of_positive, tuple(type_of(a) for a in arguments))
    found = translator._dispatchers
    assert {name.rpartition(".")[2]: len(d.overloads) for name, d in found.items()} == {
        "total_of_positive": 1,
        "next_positive": 1,
    }
