"""The benchmark of falsification: whole and shared runs have the same bytes, and its rows."""

import pytest
from tests.needed import needs

from aloft.lab.benchmarks import falsification as benchmark

needs("optuna")


@pytest.mark.long
def test_a_run_that_shares_its_beginning_costs_less() -> None:
    whole, shared, all_runs = benchmark.falsification(rounds=3)
    assert whole.value is not None and shared.value is not None and all_runs.value is not None
    assert shared.ratio is not None and 0.0 < shared.ratio < 1.0
    assert all_runs.unit == "min" and all_runs.goal == 15.0
