"""Elementary effects and Sobol indices against closed forms, and of a graph's parameters."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.needed import needs

import aloft
from aloft.extensions.analysis.studies.sensitivity import (
    Varied,
    elementary_effects,
    numeric_parameters,
    sobol_indices,
)
from aloft.studies.expansion import cells
from aloft.studies.study import Study

needs("SALib")
A, B = 7.0, 0.1
ISHIGAMI = [Varied(name, -np.pi, np.pi) for name in ("x.a", "x.b", "x.c")]


def ishigami(points: np.ndarray) -> np.ndarray:
    x, y, z = points.T
    return np.sin(x) + A * np.sin(y) ** 2 + B * z**4 * np.sin(x)


def test_sobol_indices_of_ishigamis_function_are_those_of_its_closed_form() -> None:
    """Ishigami and Homma, An Importance Quantification Technique in Uncertainty Analysis, 1990."""
    one = 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2
    two = A**2 / 8.0
    both = B**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)  # of the first and the third together
    variance = one + two + both
    found = sobol_indices(ISHIGAMI, ishigami, 4096, seed=0)
    firsts, totals = (one, two, 0.0), (one + both, two, both)
    for each, first, total in zip(ISHIGAMI, firsts, totals, strict=True):
        assert found[each.key][0] == pytest.approx(first / variance, abs=0.02)
        assert found[each.key][2] == pytest.approx(total / variance, abs=0.02)


def test_effects_of_a_linear_function_are_its_slopes_times_the_ranges() -> None:
    slopes = np.array([3.0, -0.5, 20.0, 0.0])
    wide = np.array([2.0, 10.0, 0.1, 1.0])
    varied = [Varied(f"p.{k}", 5.0, 5.0 + width) for k, width in enumerate(wide.tolist())]
    found = elementary_effects(varied, lambda points: points @ slopes, 3, seed=1)
    assert [each.key for each in found] == ["p.0", "p.1", "p.2", "p.3"]
    assert [each.mean for each in found] == pytest.approx([6.0, -5.0, 2.0, 0.0], abs=1e-9)
    assert [each.mean_size for each in found] == pytest.approx([6.0, 5.0, 2.0, 0.0], abs=1e-9)
    assert [each.spread for each in found] == pytest.approx([0.0] * 4, abs=1e-9)


def test_what_depends_on_others_has_spread() -> None:
    found = elementary_effects(ISHIGAMI, ishigami, 40, seed=0)
    assert found[0].key == "x.b" or found[0].key == "x.a"
    assert all(each.spread > 1.0 for each in found)


def test_a_metric_that_does_not_change_has_no_indices() -> None:
    found = sobol_indices(ISHIGAMI, lambda points: np.ones(len(points)), 8, seed=0)
    assert set(found.values()) == {(0.0, 0.0, 0.0, 0.0)}


def test_numbers_of_a_graph_are_found_and_those_that_may_not_vary_named(
    study: Callable[[str], Study], folder: Path
) -> None:
    (folder / "count.yaml").write_text(
        "rate: 100 Hz\nduration: 1 s\nblocks:\n"
        '  counter: {use: "counter:Counter", with: {seed: 5, goal: -2.0}}\n'
        "  f: {use: blocks.LowPass, with: {cutoff: 3 Hz}, in: {u: c.y}}\n"
        "  c: {use: blocks.Constant, with: {value: [1.0]}}\n"
    )
    (cell,) = cells(study(""))
    found, left = numeric_parameters(cell, 0.5)
    assert Varied("counter.goal", -3.0, -1.0) in found
    assert all(not each.key.endswith(".seed") for each in found)
    assert {each.key for each in found}.isdisjoint(left)


def test_runs_that_lack_the_metric_are_told_what_there_is(
    study: Callable[[str], Study], folder: Path
) -> None:
    from aloft.extensions.analysis.studies.sensitivity import _value
    from aloft.studies.execution import Run
    from aloft.studies.journal import Outcome

    (cell,) = cells(study(""))
    run = Run(cell, 0, Outcome(False, "fell", metrics={"peak_tilt_deg": 3.0, "last_count": 1.0}))
    assert (_value(run, "success"), _value(run, "peak_tilt_deg")) == (0.0, 3.0)
    with pytest.raises(
        aloft.AloftError, match=r"no number 'peak_tilt' \(fell\); there is peak_tilt_deg"
    ):
        _value(run, "peak_tilt")
