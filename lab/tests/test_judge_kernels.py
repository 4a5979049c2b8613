"""Kernels drawn from the whole language are NumPy's, and Numba's; see ``lab/judge_kernels.py``."""

from __future__ import annotations

import pytest

from aloft.lab.judge_kernels import judge


def test_drawn_kernels_are_numpys(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    tally = judge(100, seed=48, runs=1)
    assert not tally.wrong, tally.wrong[0]
    assert tally.counts["taken"] >= 75, tally
    assert tally.counts["in exported libraries"] >= 7, tally
    assert tally.counts["rounding decides"] <= 2, tally


@pytest.mark.long
def test_more_drawn_kernels_are_numpys_and_numbas(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    tally = judge(2000, seed=49, numba_every=100)
    assert not tally.wrong, tally.wrong[0]
    assert tally.counts["taken"] >= 3000 and tally.counts["judged by Numba"] >= 15, tally
    assert tally.counts["in exported libraries"] >= 150, tally
