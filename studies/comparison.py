"""Paired comparison of the settings of a study: differences over equal seeds, intervals, tests, seeds needed.

Runs are paired that differ in the compared axis only, the seed among what they share. So what a seed
draws, an easy or a hard case, is in both runs of a pair and drops out of their difference. Runs of
one seed in several cells draw the same and are not independent; seeds are. A seed's difference is the
mean over its pairs, and intervals and tests are over seeds.

Success, with b of n pairs in which only the base succeeded and c in which only the other did:

- The difference is (c - b) / n. Its interval is method 10 of R. G. Newcombe (Improved confidence
  intervals for the difference between binomial proportions based on paired data, Statistics in
  Medicine 17, 1998, 2635-2650), and with several pairs of a seed as wide as Student's over seeds at least.
- The test is exact: where nothing differs, each seed's c - b is as likely as b - c. With one pair a seed
  this is McNemar's exact test.
- A difference d shows with the probability ``POWER`` in n = (z_a sqrt(w) + z_b sqrt(w - d^2))^2 / d^2
  pairs, w = (b + c) / n (O. S. Miettinen, The matched pairs design in the case of all-or-none
  responses, Biometrics 24, 1968, 339-352), or in the seeds that a metric would take, if those are more.

A metric, over the pairs in which both runs have it: the mean over seeds with the interval and the
test of Student's t, and beside it Wilcoxon's signed-rank test, which one fall among many runs does not
decide. n = ((z_a + z_b) s / d)^2 seeds are needed, s the standard deviation of the seeds' differences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..files.problems import listing, nearest
from ..runtime.language.errors import AloftError
from .execution import Run
from .study import Study
from .summary import Z_95, wilson_interval

SUCCESS = "success"
"""Name of a comparison of success rates, beside those of metrics."""
POWER = 0.8
"""The probability with which a difference should show in as many seeds as are said to be needed."""
Z_POWER = 0.8416212335729143
"""The standard normal's quantile of ``POWER``."""


@dataclass(frozen=True)
class Comparing:
    """A request to compare: the axis (empty for nothing), its base, and the differences that should
    show, by metric."""

    axis: str
    base: str
    detect: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Comparison:
    """One metric, or success, of a setting against the base.

    Attributes:
        axis: what differs.
        base: the label that is compared with.
        other: the label that is compared.
        metric: the metric's name, or ``SUCCESS``.
        n: the seeds.
        pairs: the pairs, of which a seed has one in each cell.
        difference: other minus base; of success rates as a share.
        ci_low: lower end of its 95 % interval.
        ci_high: upper end.
        p: of the exact test, or of Student's paired test.
        p_wilcoxon: of the signed-rank test; ``None`` for success.
        only_base: pairs in which only the base succeeded; ``None`` for metrics.
        only_other: pairs in which only the other succeeded.
        detect: the difference that ``seeds_needed`` is for.
        seeds_needed: in how many seeds it shows, in as many cells each, with the probability ``POWER`` at the level of 5 %;
            ``None`` where nothing can be said.
    """

    axis: str
    base: str
    other: str
    metric: str
    n: int
    pairs: int
    difference: float
    ci_low: float
    ci_high: float
    p: float
    p_wilcoxon: float | None
    only_base: int | None
    only_other: int | None
    detect: float
    seeds_needed: int | None

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as plain data."""
        return dict(vars(self))


def read_detect(texts: Sequence[str]) -> dict[str, float]:
    """Read the differences that should show: ``0.05`` or ``5%`` for success, ``peak_tilt_deg=2``
    for a metric.

    Raises:
        AloftError: a text is of another form, or its number is no difference.
    """
    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        metric = name.strip() if equals else SUCCESS
        percent = value.strip().endswith("%")
        try:
            number = float(value.strip().removesuffix("%")) / (100.0 if percent else 1.0)
        except ValueError:
            number = math.nan
        largest = 1.0 if metric == SUCCESS else math.inf
        if not (metric and 0.0 < abs(number) <= largest and math.isfinite(number)):
            raise AloftError(
                f"--detect {text!r}: expected a difference of success rates above 0 and up to 1, such as "
                "0.05 or 5%, or that of a metric: peak_tilt_deg=2"
            )
        found[metric] = abs(number)
    return found


def compared_axis(study: Study, text: str) -> tuple[str, str]:
    """Read the axis that ``--compare`` means, and the label of its base.

    Args:
        study: the study.
        text: ``axis`` or ``axis=label``. Empty: the first of arm and the grid's axes with several labels.

    Returns:
        Both; an empty axis where nothing is asked for and the study compares nothing.

    Raises:
        AloftError: there is no such axis, it has no such label, or only one.
    """
    several = [name for name in study.axis_names if len(study.labels_of(name)) > 1]
    name, equals, label = (part.strip() for part in text.partition("="))
    if not text:
        name = next((each for each in several if each != "task"), "")
        return name, study.labels_of(name)[0] if name else ""
    if name not in several:
        known = name in study.axis_names
        problem = "has a single value" if known else "is not there"
        near = "" if known else "".join(f"; did you mean {n}?" for n in nearest(name, several)[:1])
        there = listing(several) if several else "none: the study compares nothing"
        raise AloftError(
            f"--compare {text}: the axis {name!r} {problem}; axes of several values: {there}{near}"
        )
    labels = study.labels_of(name)
    if not equals:
        return name, labels[0]
    if label not in labels:
        near = "".join(f"; did you mean {n}?" for n in nearest(label, labels)[:1])
        raise AloftError(
            f"--compare {text}: axis {name!r} has no {label!r}; it has {listing(labels)}{near}"
        )
    return name, label


def compare(study: Study, runs: Sequence[Run], asked: Comparing) -> list[Comparison]:
    """Compare every other label of the axis with the base: success first, then every metric by
    name.

    Labels without a pair are left out.

    Raises:
        AloftError: a difference is asked for of what no run has.
    """
    axis, base, detect = asked.axis, asked.base, asked.detect
    if not axis:
        return []
    pairs: dict[str, list[tuple[Run, Run]]] = {}
    bases: dict[tuple[Any, ...], Run] = {}
    made = [run for run in runs if run.outcome is not None]
    for run in made:
        if run.cell.labels[axis] == base:
            bases[_shared(run, axis)] = run
    for run in made:
        label, partner = run.cell.labels[axis], bases.get(_shared(run, axis))
        if label != base and partner is not None:
            pairs.setdefault(label, []).append((partner, run))
    found: list[Comparison] = []
    for other in (label for label in study.labels_of(axis) if label in pairs):
        mine = pairs[other]
        found.append(_success(axis, base, other, mine, detect.get(SUCCESS)))
        values: dict[str, dict[int, list[float]]] = {}
        for first, second in mine:
            before, after = _numbers(first), _numbers(second)
            for name in before.keys() & after.keys():
                by_seed = values.setdefault(name, {})
                by_seed.setdefault(second.seed, []).append(after[name] - before[name])
        for name in sorted(values):
            if len(values[name]) > 1:
                found.append(_metric(axis, base, other, name, values[name], detect.get(name)))
    names = dict.fromkeys(each.metric for each in found)
    for name in detect:
        if found and name not in names:
            near = "".join(f"; did you mean {n}?" for n in nearest(name, names)[:1])
            raise AloftError(f"--detect {name}: no pair of runs has a metric of that name{near}")
    return found


def _shared(run: Run, axis: str) -> tuple[Any, ...]:
    """Return the key that the runs of a pair share: the seed, and the labels on other axes."""
    return (run.seed, *(label for name, label in run.cell.labels.items() if name != axis))


def _numbers(run: Run) -> dict[str, float]:
    assert run.outcome is not None
    return {
        name: float(value)
        for name, value in run.outcome.metrics.items()
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    }


def _success(
    axis: str, base: str, other: str, pairs: Sequence[tuple[Run, Run]], asked: float | None
) -> Comparison:
    results = [tuple(bool(run.outcome and run.outcome.success) for run in pair) for pair in pairs]
    both, neither = results.count((True, True)), results.count((False, False))
    only_base, only_other = results.count((True, False)), results.count((False, True))
    by_seed: dict[int, list[float]] = {}
    for (_, run), (before, after) in zip(pairs, results, strict=True):
        by_seed.setdefault(run.seed, []).append(float(after - before))
    n, per_seed = len(pairs), len(pairs) / len(by_seed)
    difference = (only_other - only_base) / n
    low, high = paired_interval(both, only_other, only_base, neither)
    detect = asked or abs(difference)
    needed = pairs_for_success(detect, (only_base + only_other) / n) / per_seed
    if n > len(by_seed) > 1:
        each = _over_seeds(by_seed, asked)
        low, high = max(-1.0, min(low, each.low)), min(1.0, max(high, each.high))
        needed = max(needed, each.needed)
    p = sign_flip_p([round(sum(values)) for values in by_seed.values()])
    return Comparison(
        axis, base, other, SUCCESS, len(by_seed), n, difference, low, high, p, None, only_base,
        only_other, detect, _seeds(needed),
    )  # fmt: skip


def _metric(
    axis: str,
    base: str,
    other: str,
    name: str,
    by_seed: Mapping[int, Sequence[float]],
    asked: float | None,
) -> Comparison:
    from scipy.stats import wilcoxon

    each = _over_seeds(by_seed, asked)
    signed = float(wilcoxon(each.values).pvalue) if any(each.values) else 1.0
    pairs = sum(map(len, by_seed.values()))
    return Comparison(
        axis, base, other, name, len(by_seed), pairs, each.mean, each.low, each.high, each.p,
        signed, None, None, asked or abs(each.mean), _seeds(each.needed),
    )  # fmt: skip


class _OverSeeds(NamedTuple):
    """Student's interval and test of the seeds' mean differences, and the seeds needed."""

    values: list[float]
    mean: float
    low: float
    high: float
    p: float
    needed: float


def _over_seeds(by_seed: Mapping[int, Sequence[float]], asked: float | None) -> _OverSeeds:
    from scipy.stats import t

    values = [math.fsum(each) / len(each) for each in by_seed.values()]
    n = len(values)
    mean = math.fsum(values) / n
    deviation = math.sqrt(math.fsum((d - mean) ** 2 for d in values) / (n - 1))
    error = deviation / math.sqrt(n)
    half = float(t.ppf(0.975, n - 1)) * error
    p = 1.0 if mean == 0.0 else 0.0  # where all differences are the same
    if error > 0.0:
        p = 2.0 * float(t.sf(abs(mean) / error, n - 1))
    detect = asked or abs(mean)
    needed = ((Z_95 + Z_POWER) * deviation / detect) ** 2 if detect else math.inf
    return _OverSeeds(values, mean, mean - half, mean + half, p, needed)


def _seeds(needed: float) -> int | None:
    """Round up to whole seeds, at least two."""
    return max(2, math.ceil(needed - 1e-9)) if math.isfinite(needed) else None


def sign_flip_p(differences: Sequence[int]) -> float:
    """Return the probability that whole differences with random signs have a sum as far from zero
    as these.

    The exact distribution of the sum, term by term.
    """
    spread = sum(map(abs, differences))
    chance = [1.0]
    for size in (abs(d) for d in differences if d):
        shifted = [0.0] * (2 * size)
        pairs = zip([*chance, *shifted], [*shifted, *chance], strict=True)
        chance = [0.5 * (a + b) for a, b in pairs]
    total = abs(sum(differences))
    return min(1.0, math.fsum(p for k, p in enumerate(chance) if abs(k - spread) >= total))


def paired_interval(
    both: int, only_first: int, only_second: int, neither: int
) -> tuple[float, float]:
    """Compute the 95 % interval of a difference of paired success rates, first minus second
    (Newcombe's method 10).

    Wilson's intervals of the two rates are joined with their correlation phi, whose numerator is
    reduced by half the number of pairs where it is positive:

        low  = d - sqrt(l1^2 - 2 phi l1 u2 + u2^2),  high = d + sqrt(u1^2 - 2 phi u1 l2 + l2^2)

    with l and u the distances of a rate from the ends of its interval.
    """
    n = both + only_first + only_second + neither
    if n == 0:
        return -1.0, 1.0
    first, second = both + only_first, both + only_second
    product = first * (n - first) * second * (n - second)
    covariance = float(both * neither - only_first * only_second)
    if covariance > 0.0:
        covariance = max(0.0, covariance - n / 2)
    phi = covariance / math.sqrt(product) if product else 0.0
    ends = [(count / n, *wilson_interval(count, n)) for count in (first, second)]
    (l1, u1), (l2, u2) = ((rate - low, high - rate) for rate, low, high in ends)
    difference = (only_first - only_second) / n
    below = math.sqrt(max(0.0, l1 * l1 - 2.0 * phi * l1 * u2 + u2 * u2))
    above = math.sqrt(max(0.0, u1 * u1 - 2.0 * phi * u1 * l2 + l2 * l2))
    return difference - below, difference + above


def pairs_for_success(difference: float, unequal: float) -> float:
    """Compute the number of pairs in which a difference of success rates shows with the probability
    ``POWER``.

    Args:
        difference: of the rates, above zero.
        unequal: the share of pairs whose runs end differently; at least the difference is taken.
    """
    if difference <= 0.0:
        return math.inf
    share = max(unequal, difference)
    root = Z_95 * math.sqrt(share) + Z_POWER * math.sqrt(share - difference * difference)
    return (root / difference) ** 2
