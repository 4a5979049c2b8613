"""Paired comparison: published intervals, exact tests, seeds needed checked by simulation, what is paired."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from aloft.runtime.language.errors import AloftError
from aloft.studies.comparison import (
    POWER,
    SUCCESS,
    Comparing,
    Comparison,
    compare,
    compared_axis,
    paired_interval,
    pairs_for_success,
    read_detect,
    sign_flip_p,
)
from aloft.studies.execution import Run
from aloft.studies.expansion import cells
from aloft.studies.journal import Outcome
from aloft.studies.study import Study

Read = Callable[[str], Study]
TWO = "arms: {plain: {}, better: {}}\ngrid: {stop: {counter.stop_at: [10, 20]}}\n"


def runs_of(found: Study, judge: Callable[[str, str, int], Outcome], seeds: range) -> list[Run]:
    return [
        Run(cell, seed, judge(cell.arm, cell.labels["stop"], seed))
        for cell in cells(found)
        for seed in seeds
    ]


def by_metric(comparisons: list[Comparison]) -> dict[str, Comparison]:
    return {each.metric: each for each in comparisons}


def test_newcombes_published_interval() -> None:
    """The example of his paper's table: 36 and 12, 2 and 0."""
    assert paired_interval(36, 12, 2, 0) == pytest.approx((0.0569, 0.3404), abs=5e-5)
    low, high = paired_interval(36, 2, 12, 0)
    assert (-high, -low) == pytest.approx((0.0569, 0.3404), abs=5e-5)
    assert paired_interval(0, 0, 0, 0) == (-1.0, 1.0)
    assert paired_interval(0, 40, 0, 0)[0] > 0.8


def test_the_interval_covers_the_true_difference() -> None:
    draw = np.random.default_rng(3)
    shares = [0.6, 0.2, 0.05, 0.15]
    tables = draw.multinomial(40, shares, 2000)
    intervals = [paired_interval(*map(int, each)) for each in tables]
    assert 0.93 < np.mean([low <= 0.15 <= high for low, high in intervals]) < 0.98


def test_the_seeds_that_are_needed_show_the_difference_as_often_as_promised() -> None:
    from scipy.stats import norm

    n = math.ceil(pairs_for_success(0.1, 0.3))
    assert n == 234  # by the formula of Connor (Biometrics 43, 1987), which this is
    found = np.random.default_rng(5).multinomial(n, [0.1, 0.2, 0.7], 4000)
    z = np.abs(found[:, 0] - found[:, 1]) / np.sqrt(found[:, 0] + found[:, 1])
    assert np.mean(z > norm.ppf(0.975)) == pytest.approx(POWER, abs=0.03)
    assert pairs_for_success(0.0, 0.3) == math.inf
    assert pairs_for_success(0.2, 0.0) == pairs_for_success(0.2, 0.2)


def test_pairs_share_seed_and_cell(study: Read) -> None:
    from scipy.stats import ttest_rel

    found = study(TWO)

    def judge(arm: str, stop: str, seed: int) -> Outcome:
        hard = seed % 5 + 10.0 * (stop == "20")
        gain = 1.0 + 0.1 * seed if arm == "better" else 0.0
        good = arm == "better" or seed % 5 < 3
        return Outcome(good, "", metrics={"tilt_deg": hard - gain, "flag": True, "word": "x"})

    runs = runs_of(found, judge, range(10))
    result = by_metric(compare(found, runs[:-1], Comparing("arm", "plain")))
    assert result.keys() == {SUCCESS, "tilt_deg"}
    success, tilt = result[SUCCESS], result["tilt_deg"]
    assert (success.n, success.pairs, success.only_base, success.only_other) == (10, 19, 0, 7)
    # three seeds with two pairs and one with one: all of one sign
    assert success.p == pytest.approx(2 * 0.5**4) and success.difference == pytest.approx(7 / 19)
    gains = [1.0 + 0.1 * seed for seed in range(10)]
    assert tilt.difference == pytest.approx(-np.mean(gains))
    assert tilt.p == pytest.approx(ttest_rel(gains, [0.0] * 10).pvalue)
    assert tilt.ci_low < tilt.difference < tilt.ci_high < 0
    assert tilt.p_wilcoxon == pytest.approx(2 * 0.5**10)
    assert tilt.seeds_needed == 2
    asked = Comparing("arm", "plain", {"tilt_deg": 0.1, SUCCESS: 0.05})
    exact = by_metric(compare(found, runs, asked))
    pairs = ((1.959964 + 0.841621) * np.std(gains, ddof=1) / 0.1) ** 2
    assert exact["tilt_deg"].seeds_needed == math.ceil(pairs)
    assert exact[SUCCESS].detect == 0.05 and exact[SUCCESS].to_json()["n"] == 10


def test_a_seed_counts_once_in_however_many_cells(study: Read) -> None:
    """Cells that repeat each other add nothing: neither to the test nor to the interval of a metric."""
    found = study(TWO)

    def judge(arm: str, stop: str, seed: int) -> Outcome:
        better = arm == "better"
        return Outcome(seed < 4 or better, "", metrics={"a": better * (0.1 + seed)})

    runs = runs_of(found, judge, range(6))
    one = [run for run in runs if run.cell.labels["stop"] == "10"]
    single, double = (
        by_metric(compare(found, each, Comparing("arm", "plain"))) for each in (one, runs)
    )
    for name in (SUCCESS, "a"):
        assert double[name].p == single[name].p and double[name].pairs == 2 * single[name].pairs
    assert double["a"].ci_low == single["a"].ci_low
    assert double[SUCCESS].seeds_needed == 19  # seeds: ((z_a + z_b) sqrt(4 / 15) / (1 / 3))^2


def test_the_exact_test_is_mcnemars_with_one_pair_a_seed() -> None:
    from itertools import product

    from scipy.stats import binomtest

    for only_base, only_other in product(range(8), range(8)):
        if only_base + only_other:
            p = sign_flip_p([*[-1] * only_base, *[1] * only_other, 0, 0])
            n = only_base + only_other
            assert p == pytest.approx(binomtest(only_other, n).pvalue, rel=1e-12)
    sizes = [3, 1, 2, 2]
    sums = [abs(sum(s * d for s, d in zip(signs, sizes, strict=True)))
            for signs in product((-1, 1), repeat=4)]  # fmt: skip
    assert sign_flip_p([3, -1, 2, 2]) == sum(each >= 6 for each in sums) / 16
    assert sign_flip_p([]) == sign_flip_p([0, 0]) == sign_flip_p([1, -1]) == 1.0


def test_without_any_difference_nothing_is_claimed(study: Read) -> None:
    found = study(TWO)
    runs = runs_of(found, lambda *_: Outcome(True, "", metrics={"a": 1.0}), range(4))
    same = by_metric(compare(found, runs, Comparing("stop", "20")))
    for each in same.values():
        assert (each.difference, each.p, each.seeds_needed) == (0.0, 1.0, None)
    assert same["a"].other == "10" and same["a"].p_wilcoxon == 1.0
    shifted = [
        Run(run.cell, run.seed, Outcome(True, "", metrics={"a": float(run.cell.arm == "better")}))
        for run in runs
    ]
    assert by_metric(compare(found, shifted, Comparing("arm", "plain")))["a"].p == 0.0
    assert compare(found, runs, Comparing("", "")) == []
    only = [run for run in runs if run.cell.arm == "better"]
    assert compare(found, only, Comparing("arm", "plain")) == []


def test_what_is_compared(study: Read) -> None:
    found = study(TWO)
    assert compared_axis(found, "") == ("arm", "plain")
    assert compared_axis(found, "stop") == ("stop", "10")
    assert compared_axis(found, " arm = better ") == ("arm", "better")
    assert compared_axis(study(TWO.splitlines()[1]), "") == ("stop", "10")
    assert compared_axis(study(""), "") == ("", "")
    for text, problem in {
        "stops": r"the axis 'stops' is not there; .*: arm, stop; did you mean stop\?",
        "task": "the axis 'task' has a single value; axes of several values: arm, stop",
        "arm=beter": r"axis 'arm' has no 'beter'; it has plain, better; did you mean better\?",
    }.items():
        with pytest.raises(AloftError, match=problem):
            compared_axis(found, text)
    with pytest.raises(AloftError, match="none: the study compares nothing"):
        compared_axis(study(""), "arm")


def test_differences_that_should_show(study: Read) -> None:
    assert read_detect(["5%", "tilt_deg=-2"]) == {SUCCESS: 0.05, "tilt_deg": 2.0}
    for text in ("0", "120%", "much", "=3", "a=nan"):
        with pytest.raises(AloftError, match="expected a difference of success rates above 0"):
            read_detect([text])
    found = study(TWO)
    runs = runs_of(found, lambda *_: Outcome(True, "", metrics={"tilt_deg": 1.0}), range(2))
    with pytest.raises(
        AloftError, match=r"no pair of runs has a metric .*; did you mean tilt_deg\?"
    ):
        compare(found, runs, Comparing("arm", "plain", {"tilt_degs": 1.0}))
