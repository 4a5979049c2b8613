"""A frequency response measured in runs: a chirp is added on a wire, and what comes of it is compared.

A fault of the kind ``chirp`` adds r to what a block writes, u, so that y = u + r is read. In every period of the
chirp the Fourier coefficients of these signals at its frequencies are one sample, over all periods and seeds. With the means
U, Y and R and their covariances the response is

* of an opened loop -U / Y, with negative feedback as margins have it; the loop stays closed in the runs;
* of a closed one B / R, with B of what is observed.

The first period is left out: the loop comes to its periodic state in it. A ratio N / D of two means over M samples has the
variance |N / D|^2 (var N / |N|^2 + var D / |D|^2 - 2 Re(cov(N, D) / (N conj D))) / M, and the true response lies
with 95 % within sqrt(F) standard deviations, F the quantile of Fisher's distribution with 2 and 2 M - 2 degrees
(Pintelon and Schoukens, System Identification, 2nd ed., 2012, chapter 2). The coherence is the share of the power of what is
observed that follows the chirp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...logs.file.header import recorded_signals
from ...mathematics.arrays import Array
from ...runtime.graph import Graph, load
from ...runtime.language.errors import AloftError
from ...runtime.language.signal_error import FOLDER, chirp_lines
from ...runtime.language.stages import CheckedGraph
from ...runtime.running.memory import BoundGraph
from .coordinates import signal_coordinates

NAME = "chirp"
"""Name of the fault that adds the chirp."""
LEVEL = 0.95
"""Probability content of the confidence regions."""


@dataclass(frozen=True)
class FrequencyResponse:
    """A response measured in runs.

    Attributes:
        source, target: the names of the element to which the chirp was added and of what was observed.
        opened: whether it is the transfer of the loop opened at ``source``, with negative feedback.
        frequency: in Hz, (n,).
        value: the response, (n,), complex.
        radius: of the circle around ``value`` in which the true one lies with 95 %, (n,).
        coherence: the share of the observed power that follows the chirp, (n,), 0 to 1.
        samples: periods times seeds.
    """

    source: str
    target: str
    opened: bool
    frequency: Array
    value: NDArray[np.complex128]
    radius: Array
    coherence: Array
    samples: int

    def holds(self, predicted: NDArray[np.complex128]) -> NDArray[np.bool_]:
        """Check at which frequencies, (n,), a predicted response lies within the circles."""
        return np.asarray(np.abs(predicted - self.value) <= self.radius, np.bool_)

    def as_data(self) -> dict[str, Any]:
        """Return all fields as plain data."""
        return {
            "source": self.source, "target": self.target, "opened": self.opened,
            "frequency_hz": self.frequency.tolist(), "real": self.value.real.tolist(),
            "imaginary": self.value.imag.tolist(), "radius": self.radius.tolist(),
            "coherence": self.coherence.tolist(), "samples": self.samples,
        }  # fmt: skip


def frequency_responses(
    graph: Graph | str | Path,
    *,
    inputs: str,
    outputs: str | Sequence[str] = (),
    at: float,
    size: float | str,
    seeds: Sequence[int],
    low: float = 1.0,
    high: float = 50.0,
    period: float = 1.0,
    periods: int = 4,
) -> list[FrequencyResponse]:
    """Measure responses: from each element of ``inputs``, one after another, to all of ``outputs``.

    The runs are as many as elements of ``inputs`` times seeds, however many outputs there are.

    Args:
        graph: a graph or its file. It must last for ``at`` and one period more than ``periods``.
        inputs: elements such as ``joint_pd.command.torque[*_knee]``.
        outputs: what is observed, one selection or several, all in the same runs; empty for the loop that is opened at
            each element of ``inputs``, the others closed.
        at: when the chirp begins [s].
        size: its root mean square, in the unit of the signal or as ``50 mN m``.
        seeds: of the runs.
        low, high, period, periods: the frequencies [Hz], the time after which the chirp repeats itself [s], and how
            many periods count in a run.

    Raises:
        AloftError: there is no such signal, or a run ends before the last period.
        LoadError: no chirp can be put there.
    """
    loaded = graph if isinstance(graph, Graph) else load(graph)
    if len(seeds) * periods < 3:
        raise AloftError("an interval needs at least 3 samples: periods times seeds")
    bound = BoundGraph(loaded.checked)
    signals = {field.name: field for field in recorded_signals(bound)}
    chosen = signal_coordinates(bound, signals, inputs)
    targets = [outputs] if isinstance(outputs, str) and outputs else list(outputs)
    seen = [signal_coordinates(bound, signals, each) for each in dict.fromkeys(targets)]
    if any(each.quaternion for each in (chosen, *seen)):
        raise AloftError("a chirp goes on numbers, not on orientations; choose a rate")
    locate = bound.memory.bus.layout.locate
    settings = {
        "kind": "chirp",
        "value": size,
        "low": low,
        "high": high,
        "time": period,
        "start": at,
    }
    found = []
    for label, place in zip(chosen.labels, chosen.places.tolist(), strict=True):
        element = locate("float64", place)
        chirped = loaded.changed({f"faults.{NAME}": {"on": element, **settings}})
        window = _Window.of(chirped.checked, at, period, periods, low, high)
        written, read, observed = [], [], []
        for seed in seeds:
            rows = _rows(chirped, seed, window)
            written.append(window.coefficients(rows, element, chosen.block))
            _, _, rest = element.removeprefix(f"{chosen.block}.").partition(".")
            read.append(window.coefficients(rows, f"{FOLDER}{NAME}.y.{rest}", chosen.block))
            observed.append([
                window.coefficients(rows, locate("float64", each), target.block)
                for target in seen
                for each in target.places.tolist()
            ])  # fmt: skip
        u, y = np.concatenate(written), np.concatenate(read)
        if not seen:
            found.append(_response(label, label, True, window.lines, -u, y, y - u))
            continue
        for k, name in enumerate(name for target in seen for name in target.labels):
            b = np.concatenate([each[k] for each in observed])
            found.append(_response(label, name, False, window.lines, b, y - u, y - u))
    return found


def _rows(chirped: Graph, seed: int, window: _Window) -> Any:
    """Return a function that gives an element of a signal in the ticks of the window."""
    result = chirped.run(window.last / chirped.checked.base_rate, seed=seed)
    if result.ticks < window.last:
        raise AloftError(
            f"the run with seed {seed} ended at {result.ticks * result.period:g} s, before the last period of "
            f"the chirp, which ends at {window.last * result.period:g} s: {result.reason}"
        )

    def element(name: str) -> Array:
        field, _, index = name.partition("[")
        values = result.signal(field)[window.first : window.last]
        places = map(int, index.removesuffix("]").split(",")) if index else ()
        of_all: tuple[Any, ...] = (slice(None), *places)
        return np.asarray(values[of_all], np.float64)

    return element


@dataclass(frozen=True)
class _Window:
    """The ticks that count, in whole periods of the chirp, and its frequencies."""

    graph: CheckedGraph
    first: int
    last: int
    length: int
    lines: Array

    @classmethod
    def of(
        cls, graph: CheckedGraph, at: float, period: float, periods: int, low: float, high: float
    ) -> _Window:
        length, start = round(period * graph.base_rate), round(at * graph.base_rate)
        common = int(np.lcm.reduce([spec.period_ticks for spec in graph.blocks]))
        if length % common or abs(length - period * graph.base_rate) > 1e-6:
            raise AloftError(
                f"the period of the chirp is {period:g} s; it must be a multiple of {common * graph.base_period:g} s, "
                "the period of all rates of the graph"
            )
        start = -(-start // common) * common
        lines = chirp_lines(low, high, period)
        return cls(graph, start + length, start + (periods + 1) * length, length, lines)

    def coefficients(self, rows: Any, name: str, block: str) -> NDArray[np.complex128]:
        """Return the Fourier coefficients of an element, (periods, frequencies), without the trend of its means over
        periods.

        A block of a slower rate has a sample for every time that it runs.
        """
        spec = self.graph.block(block)
        ticks = np.arange(self.first, self.last)
        ticks = ticks[(ticks - spec.offset_ticks) % spec.period_ticks == 0]
        values = rows(name)[ticks - self.first]
        times = ticks / self.graph.base_rate
        count = self.length // spec.period_ticks
        middles, means = (each.reshape(-1, count).mean(axis=1) for each in (times, values))
        if len(means) > 1:  # the chirp itself has no trend in these
            values = values - np.polyval(np.polyfit(middles, means, 1), times)
        turns = np.exp(-2j * np.pi * times[:, None] * self.lines)
        whole = (values[:, None] * turns).reshape(-1, count, len(self.lines))
        found: NDArray[np.complex128] = whole.mean(axis=1)
        return found


def _response(
    source: str, target: str, opened: bool, lines: Array,
    numerator: NDArray[np.complex128], denominator: NDArray[np.complex128],
    chirp: NDArray[np.complex128],
) -> FrequencyResponse:  # fmt: skip
    """Return the ratio of two means over (samples, frequencies), and how certain it is."""
    from scipy.stats import f as fisher

    m = len(numerator)
    n, d = numerator.mean(axis=0), denominator.mean(axis=0)
    dn, dd = numerator - n, denominator - d
    value = n / d
    # of N - G D, the residual at the estimate: the same as the three terms of the ratio
    residual = np.sum(np.abs(dn - value * dd) ** 2, axis=0) / (m - 1)
    deviation = np.sqrt(residual / m) / np.abs(d)
    radius = deviation * np.sqrt(float(fisher.ppf(LEVEL, 2, 2 * m - 2)))
    aligned = numerator * np.conj(chirp)
    power = np.mean(np.abs(numerator) ** 2, axis=0) * np.mean(np.abs(chirp) ** 2, axis=0)
    coherence = np.abs(aligned.mean(axis=0)) ** 2 / np.maximum(power, 1e-300)
    return FrequencyResponse(source, target, opened, lines, value, radius, coherence, m)
