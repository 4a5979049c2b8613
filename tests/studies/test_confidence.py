"""Wilson's interval against published and independently derived values."""

import math

import pytest

from aloft.studies.confidence import Z_95, wilson_interval


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
