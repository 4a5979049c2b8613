"""The fast product has the bits of BLASFEO's, and takes its place only where that is sure."""

from __future__ import annotations

import ctypes
import platform
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from aloft.planner.solving import blasfeo

OF_LINUX = sys.platform.startswith("linux") and platform.machine() == "x86_64"


@pytest.fixture
def library() -> blasfeo._Library:
    ca.load_nlpsol("fatrop")
    found = blasfeo._loaded_library()
    if found is None:
        pytest.skip("CasADi has no BLASFEO of its own here")
    return found


@pytest.mark.parametrize("length", [0, 1, 4, 23])
def test_each_sum_has_its_terms_in_their_order(length: int) -> None:
    draw = np.random.default_rng(length)
    left, right = draw.normal(size=(2, length + 1, 4))
    added, found = draw.normal(size=(2, 4, 4))
    factors = np.array([-0.3, 0.7])
    blasfeo._PRODUCT_TYPE(blasfeo.fast_product())(
        length, factors[:1].ctypes.data, left.ctypes.data, right.ctypes.data,
        factors[1:].ctypes.data, added.ctypes.data, found.ctypes.data,
    )  # fmt: skip
    total = np.zeros((4, 4))
    for k in range(length):
        total = total + left[k] * right[k][:, None]
    np.testing.assert_array_equal(found, 0.7 * added + -0.3 * total)


@pytest.mark.skipif(not OF_LINUX, reason="a table of another kind")
def test_blasfeo_calls_the_fast_product(library: blasfeo._Library) -> None:
    assert blasfeo.use_fast_product()
    place = library.base + blasfeo._entry(library.path.read_bytes())
    assert ctypes.c_uint64.from_address(place).value == blasfeo.fast_product()


@pytest.mark.parametrize("case", ["not loaded", "another file", "read-only", "other bytes"])
def test_elsewhere_all_stays_as_it_is(
    case: str, library: blasfeo._Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = library.base + blasfeo._entry(library.path.read_bytes())
    entry = ctypes.c_uint64.from_address(place)
    known = entry.value
    entry.value = known + 0  # it can be written, so only the case stands in the way
    other = tmp_path / "libblasfeo.so"
    other.write_bytes(b"\x7fELF" + bytes(100))
    seen = {
        "not loaded": None,
        "another file": library._replace(path=other),
        "read-only": library._replace(writable=[]),
    }.get(case, library)
    monkeypatch.setattr(blasfeo, "_loaded_library", lambda: seen)
    if case == "other bytes":
        monkeypatch.setattr(blasfeo, "_same", lambda own, theirs: False)
    assert not blasfeo.use_fast_product.__wrapped__()
    assert entry.value == known


def test_a_product_of_other_bits_is_told() -> None:
    own = blasfeo._PRODUCT_TYPE(blasfeo.fast_product())

    def off(*arguments: int) -> None:
        own(*arguments)
        ctypes.c_double.from_address(arguments[-1]).value *= 1.0 + 1e-15

    assert blasfeo._same(own, own)
    assert not blasfeo._same(own, off)
