"""Wilson's interval against published and independently derived values."""

import math
from collections.abc import Callable
from pathlib import Path

import pyarrow
import pytest
from pyarrow import parquet

from aloft.studies.execution import Run
from aloft.studies.expansion import cells
from aloft.studies.journal import Outcome
from aloft.studies.study import Study
from aloft.studies.summary import (
    Z_95,
    figures_of,
    make_table,
    quantile,
    summarise,
    wilson_interval,
    write_table,
)


@pytest.mark.parametrize(
    ("successes", "n", "low", "high"),
    [
        # Newcombe 1998 (Statistics in Medicine 17), table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_published_values(successes: int, n: int, low: float, high: float) -> None:
    assert wilson_interval(successes, n) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize("n", [1, 7, 40, 1000])
def test_the_ends_are_where_the_score_test_just_rejects(n: int) -> None:
    for successes in {0, 1, n // 2, n - 1, n}:
        share = successes / n
        for end in wilson_interval(successes, n):
            if 0 < end < 1:
                assert abs(share - end) == pytest.approx(Z_95 * math.sqrt(end * (1 - end) / n))
        low, high = wilson_interval(successes, n)
        assert 0 <= low <= share <= high <= 1


def test_symmetry_no_runs_and_nonsense() -> None:
    low, high = wilson_interval(3, 11)
    assert wilson_interval(8, 11) == pytest.approx((1 - high, 1 - low))
    assert wilson_interval(0, 0) == (0, 1)
    with pytest.raises(ValueError, match="3 successes of 2 runs"):
        wilson_interval(3, 2)


Read = Callable[[str], Study]


def two_cells(found: Study) -> list[Run]:
    first, second = cells(found)
    return [
        Run(first, 0, Outcome(True, "", "h", {"a_m": 1, "flag": True, "word": "x", "b": 2})),
        Run(first, 1, Outcome(False, "fell", "h", {"a_m": 2.5, "b": 4})),
        Run(second, 1000, Outcome(False, "fell", "h", {"a_m": None, "seed": 5}, "broke", 3.0)),
    ]


def test_columns_have_one_type_and_nulls_where_nothing_is(tmp_path: Path, study: Read) -> None:
    found = study("grid: {x: {counter.goal: [10 mm, 2 cm]}, y: {cases: {one: {}}}}\n")
    write_table(tmp_path / "runs.parquet", make_table(two_cells(found)))
    table = parquet.read_table(tmp_path / "runs.parquet")
    types = {field.name: str(field.type) for field in table.schema}
    assert types == {
        "task": "string", "arm": "string", "x_mm": "double", "y": "string", "seed": "int64",
        "tuning_seed": "bool", "success": "bool", "reason": "string", "error": "string",
        "run_hash": "string", "a_m": "double", "b": "int64", "flag": "bool",
        "metric.seed": "int64", "word": "string", "wall_time_s": "double",
    }  # fmt: skip
    zeros = pyarrow.table({"zero": [0.0, 0.0]})
    write_table(tmp_path / "zeros.parquet", zeros)
    rule = [("zero", "in", [0.0])]
    assert len(parquet.read_table(tmp_path / "zeros.parquet", filters=rule)) == 2
    assert table["x_mm"].to_pylist() == [10.0, 10.0, 20.0]
    assert table["a_m"].to_pylist() == [1.0, 2.5, None]
    assert table["tuning_seed"].to_pylist() == [True, True, False]


def test_a_row_sums_up_its_cell(study: Read) -> None:
    found = study(
        "grid: {x: {counter.goal: [1, 2]}}\ngoals: [{rate: 0.9}, {rate: 0.5, where: {x: 1}}]\n"
    )
    first, second = summarise(found, two_cells(found))
    assert (first.n, first.successes, first.rate, first.errors) == (2, 1, 0.5, 0)
    assert (first.goal, first.met, second.goal, second.met) == (0.5, True, 0.9, False)
    assert (second.errors, dict(second.reasons)) == (1, {"fell": 1})
    assert set(first.metrics) == {"a_m", "b"} and second.metrics.keys() == {"seed"}
    assert first.metrics["a_m"].mean == 1.75
    assert first.to_json()["x"] == 1.0


def test_quantiles_are_linear_between_values() -> None:
    assert [quantile([1.0, 2.0, 4.0], q) for q in (0, 0.25, 0.5, 0.75, 1)] == [1, 1.5, 2, 3, 4]
    figures = figures_of([3.0, 1.0, 2.0])
    assert (figures.n, figures.mean, figures.median) == (3, 2.0, 2.0)
    assert math.isclose(figures.low, 1.1) and math.isclose(figures.high, 2.9)
    assert figures_of([7.0]).high == pytest.approx(7.0)
