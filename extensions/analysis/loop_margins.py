"""Stability margins of a loop: gain, phase, delay and disk margins, of each channel and of all at once.

The loop transfer L of an opened wire, from what is read there to what the block writes, has the sign of the
feedback in it: the loop is closed by u = L u, and its return difference is I - L. The margins of a channel
are those of -L with all other channels closed, as python-control has them. Those of all channels at once
come from the eigenvalues of L(w), the characteristic loci: a delay tau in all channels, or a factor, brings
the loop to its limit where an eigenvalue times exp(-i w tau), or the factor, is 1 (MacFarlane and
Postlethwaite, 1977). The disk margin of all channels is that for perturbations of any structure,
alpha = 2 / max sigma(S - T), which bounds that of separate perturbations from below (Seiler, Packard and
Gahinet, An Introduction to Disk Margins, 2020). Gains at which the loop becomes unstable are confirmed by the
poles of the closed loop, and found at frequency 0 and half the sampling rate, too; see ``gain_limits``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mathematics.arrays import Array
from ...runtime.language.errors import AloftError
from .gain_limits import ON_CIRCLE, ClosedLoop
from .linearisation import Linearisation, import_control, sorted_poles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .frequency_response import FrequencyResponse

POINTS = 1000
"""Frequencies at which the response is computed, evenly in their logarithm."""
DECADES = 4.0
"""Decades from the lowest frequency to the highest, half the sampling rate."""
NEAR_HALF = (0.995, 0.998, 0.999, 0.9995, 0.9999, 1.0)
"""Shares of half the sampling rate at which the response is computed beyond those."""


@dataclass(frozen=True)
class LoopMargins:
    """The margins of one loop; infinite where nothing brings it to its limit.

    Attributes:
        gain_up, gain_down: the factors on the loop's gain at which a pole of the closed loop leaves the
            unit circle, or comes back to it: the least above 1, and the greatest below it, 0 where there is none.
        phase: the least lag that it does not stand [deg].
        delay: the least delay that it does not stand [s].
        crossover: the frequency of the phase margin [rad/s]; ``nan`` where there is none.
        disk: the disk margin alpha, without a unit.
        sensitivity_peak: the largest singular value of the sensitivity S, and ``peak_at`` [rad/s].
    """

    gain_up: float
    gain_down: float
    phase: float
    delay: float
    crossover: float
    disk: float
    sensitivity_peak: float
    peak_at: float


@dataclass(frozen=True)
class Margins:
    """The margins of an opened wire.

    Attributes:
        channels: by name, with all others closed.
        together: with the same change in all channels at once.
        stable: whether the closed loop is stable; poles on the unit circle count as drift.
        growth: the rate of its fastest growing mode [1/s], negative where all of them decay.
        poles: of the closed loop, complex, the slowest first.
        frequency: where the response was computed [rad/s].
        loops: the transfer of each channel with all others closed, negative feedback, (frequencies, n).
    """

    channels: Mapping[str, LoopMargins]
    together: LoopMargins
    stable: bool
    growth: float
    poles: Any
    frequency: Array
    loops: Any

    def as_data(self) -> dict[str, Any]:
        """Return all fields but the curves as plain data."""
        return {
            "stable": self.stable,
            "growth_per_s": self.growth,
            "together": asdict(self.together),
            "channels": {name: asdict(each) for name, each in self.channels.items()},
            "closed_loop_poles": [[float(p.real), float(p.imag)] for p in self.poles],
        }


def margins(model: Linearisation) -> Margins:
    """Return the margins of the loop that was opened at a wire.

    Args:
        model: of a wire, opened, to itself.

    Raises:
        AloftError: it is another model, or python-control is not installed.
    """
    if not model.opened or model.inputs != model.outputs:
        raise AloftError(
            "margins are those of a loop that is opened at a wire: linearise with the same signal as "
            "input and output, opened"
        )
    n = len(model.b.T)
    closed = model.a + model.b @ np.linalg.solve(np.eye(n) - model.d, model.c)
    poles = sorted_poles(closed)
    names = list(dict.fromkeys(name.partition("@")[0] for name in model.inputs))
    samples = len(model.inputs) / len(names)  # in a period
    highest = np.log10(np.pi * samples / model.period)
    w = np.logspace(highest - DECADES, highest, POINTS)[:-1]
    w = np.concatenate([w, 10.0**highest * np.array(NEAR_HALF)])
    transfer, loops = model.response(w), loop_responses(model, w)
    columns = {
        name: [k for k, each in enumerate(model.inputs) if each.partition("@")[0] == name]
        for name in names
    }
    return Margins(
        {
            name: _of_channel(w, loops[:, k], ClosedLoop(model, columns[name], float(w[0])))
            for k, name in enumerate(names)
        },
        _of_all(w, transfer, ClosedLoop(model, range(n), float(w[0]))),
        bool((np.abs(poles) <= 1.0 + ON_CIRCLE).all()),
        float(np.log(max(np.abs(poles).max(initial=0.0), 1e-300)) / model.period),
        poles,
        w,
        loops,
    )


def loop_responses(model: Linearisation, w: Array) -> Any:
    """Return the transfer of each channel of an opened wire with the others closed, negative feedback, (frequencies,
    n), at frequencies in rad/s.
    """
    return -_each_alone(model.response(w))


def _each_alone(transfer: Any) -> Any:
    """Return the transfer of each channel with the others closed, (frequencies, n)."""
    n = transfer.shape[1]
    found = np.empty(transfer.shape[:2], complex)
    for k in range(n):
        others = [j for j in range(n) if j != k]
        found[:, k] = transfer[:, k, k]
        if others:
            inner = np.eye(n - 1) - transfer[:, others][:, :, others]
            through = np.linalg.solve(inner, transfer[:, others, k][..., None])[..., 0]
            found[:, k] += (transfer[:, k, others] * through).sum(axis=1)
    return found


def _of_channel(w: Array, loop: Any, closed: ClosedLoop) -> LoopMargins:
    """Return the margins of one transfer with negative feedback."""
    control = import_control()
    response = control.FrequencyResponseData(loop[:-1], w[:-1], smooth=True)
    gains, phases, _, _, crossings, _ = control.stability_margins(response, returnall=True)
    lags = np.mod(np.atleast_1d(phases), 360.0)  # a lag of 350 degrees is a lead of 10
    leads = np.minimum(lags, 360.0 - lags)
    delays = np.radians(lags) / np.atleast_1d(crossings)
    first = int(np.argmin(leads)) if len(leads) else -1
    return _margins(
        closed.limits(np.atleast_1d(gains)), float(leads.min(initial=np.inf)), float(delays.min(initial=np.inf)),
        float(np.atleast_1d(crossings)[first]) if len(leads) else np.nan,
        w, 1.0 / (1.0 + loop)[:, None, None],
    )  # fmt: skip


def _of_all(w: Array, transfer: Any, closed: ClosedLoop) -> LoopMargins:
    """Return the margins for the same change in all channels, by the characteristic loci."""
    from scipy.optimize import linear_sum_assignment

    loci = np.linalg.eigvals(transfer[:-1])
    for k in range(1, len(loci)):  # in the order of the frequency before
        distance = np.abs(loci[k - 1][:, None] - loci[k])
        loci[k] = loci[k, linear_sum_assignment(distance)[1]]
    size, turn = np.abs(loci), np.unwrap(np.angle(loci), axis=0)
    phases, delays, crossings, gains = [], [], [], []
    for j in range(loci.shape[1]):
        for k in np.flatnonzero((size[1:, j] > 1.0) != (size[:-1, j] > 1.0)).tolist():
            share = (1.0 - size[k, j]) / (size[k + 1, j] - size[k, j])
            at = w[k] + share * (w[k + 1] - w[k])
            lag = float(np.mod(turn[k, j] + share * (turn[k + 1, j] - turn[k, j]), 2.0 * np.pi))
            delays.append(float(lag / at))
            phases.append(float(np.degrees(min(lag, 2.0 * np.pi - lag))))
            crossings.append(float(at))
        rounds = np.floor(turn[:, j] / (2.0 * np.pi))
        for k in np.flatnonzero(rounds[1:] != rounds[:-1]).tolist():
            border = 2.0 * np.pi * max(rounds[k], rounds[k + 1])
            share = (border - turn[k, j]) / (turn[k + 1, j] - turn[k, j])
            gains.append(1.0 / (size[k, j] + share * (size[k + 1, j] - size[k, j])))
    first = int(np.argmin(phases)) if phases else -1
    n = transfer.shape[1]
    sensitivity = np.linalg.inv(np.eye(n) - transfer)
    return _margins(
        closed.limits(np.array(gains)), min(phases, default=np.inf), min(delays, default=np.inf),
        crossings[first] if phases else np.nan, w, sensitivity,
    )  # fmt: skip


def _margins(
    gains: tuple[float, float], phase: float, delay: float, crossover: float, w: Array,
    sensitivity: Any,
) -> LoopMargins:  # fmt: skip
    peak = np.linalg.norm(sensitivity, 2, axis=(1, 2))
    # with T = I - S, the disk margin's S - T is 2 S - I
    disk = np.linalg.norm(2.0 * sensitivity - np.eye(sensitivity.shape[1]), 2, axis=(1, 2))
    at = int(peak.argmax())
    return LoopMargins(
        *gains, phase, delay, crossover, float(2.0 / disk.max()), float(peak[at]), float(w[at]),
    )  # fmt: skip


def margins_figure(
    found: Margins,
    title: str,
    names: Sequence[str] = (),
    measured: Mapping[str, FrequencyResponse] | None = None,
) -> Figure:
    """Return the Bode and Nyquist diagrams of all channels, or of some, each with the others closed.

    What was ``measured`` of a channel is drawn as points, with bars of 95 % where that is less than the value.
    """
    from ...plotting import COLOURS, FAINT, new_figure

    figure = new_figure(9.0, 4.5, title)
    grid = figure.add_gridspec(2, 2)
    gain, phase = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    nyquist = figure.add_subplot(grid[:, 1])
    hertz = found.frequency / (2.0 * np.pi)
    for k, name in enumerate(found.channels):
        if names and name not in names:
            continue
        loop, colour = found.loops[:, k], COLOURS[k % len(COLOURS)]
        gain.semilogx(hertz, 20.0 * np.log10(np.abs(loop)), color=colour, label=name)
        phase.semilogx(hertz, np.degrees(np.unwrap(np.angle(loop))), color=colour)
        nyquist.plot(loop.real, loop.imag, color=colour)
        points = (measured or {}).get(name)
        if points is not None:
            _draw_measured(points, loop, hertz, gain, phase, colour)
    circle = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    nyquist.plot(circle.real, circle.imag, color=FAINT, linewidth=0.7)
    nyquist.plot([-1.0], [0.0], "+", color=FAINT)
    nyquist.set(xlim=(-3.0, 2.0), ylim=(-2.5, 2.5), aspect="equal", title="Nyquist")
    gain.set(ylabel="gain [dB]")
    gain.axhline(0.0, color=FAINT, linewidth=0.7)
    phase.set(ylabel="phase [deg]", xlabel="frequency [Hz]")
    if len(gain.lines) > 1:
        gain.legend(fontsize=6.0)
    return figure


def _draw_measured(
    points: FrequencyResponse, loop: Any, hertz: Array, gain: Axes, phase: Axes, colour: str
) -> None:
    """Draw points with bars, each phase on the turn of the model's curve."""
    sure = points.radius < np.abs(points.value)
    size, share = np.abs(points.value), np.where(sure, points.radius / np.abs(points.value), 0.0)
    bars = 20.0 * np.log10(np.array([1.0 / (1.0 - share), 1.0 + share]))
    style = {"fmt": ".", "color": colour, "markersize": 3.0, "elinewidth": 0.7}
    gain.errorbar(points.frequency, 20.0 * np.log10(size), yerr=bars, **style)
    model = np.interp(points.frequency, hertz, np.degrees(np.unwrap(np.angle(loop))))
    angle = np.degrees(np.angle(points.value))
    angle = angle + 360.0 * np.round((model - angle) / 360.0)
    phase.errorbar(
        points.frequency[sure], angle[sure], yerr=np.degrees(np.arcsin(share[sure])), **style
    )
