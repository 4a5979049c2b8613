"""The benchmark of chains of general blocks: that it is fair; how fast is for ``aloft bench``."""

from __future__ import annotations

import shutil

import pytest

from aloft.lab.benchmarks import general_blocks as benchmark

TIMED = ("Gain", "MovingAverage")


@pytest.mark.long
def test_chains_compute_what_the_calls_in_c_compute() -> None:
    rows = {row.name: row for row in benchmark.general_blocks(rounds=2)}
    compiler = any(map(shutil.which, ("cc", "gcc", "clang")))
    for name in TIMED:
        fused = rows[f"1,000 {name}, fused"]
        assert fused.value is not None and fused.value > 0.0
        assert (fused.ratio is not None) == compiler
        first = rows[f"1,000 {name}, first start"].value
        assert first is not None and first > 0.0


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_other_bits_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = benchmark.C_SOURCE.replace("b->gain * *b->u", "b->gain * *b->u + 1e-15")
    monkeypatch.setattr(benchmark, "C_SOURCE", wrong)
    with pytest.raises(AssertionError, match="Gain: other bits than in C"):
        benchmark.general_blocks(rounds=1)
