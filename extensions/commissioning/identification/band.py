"""The band of frequencies in which a log is fitted, its low-pass, and motion by two halves of the samples.

Above the band that the motors drive, what moves are vibrations of gears and stands: accelerations without a measured torque. They
bias a least-squares fit as noise does: on the double pendulum's slow logs the moments are 20 % low at 10 Hz and
37 % at 15 Hz, and no longer depend on the band below 5 Hz. So the band follows from the torque's spectrum.

Equations are formed at the full band and low-passed then, both sides by the same symmetric window, so that neither friction nor
products of speeds are bent. Encoder noise in accelerations biases a fit, too. Motion from even and from odd samples has
independent noise: the one forms the equations, the other the instruments.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from .base_parameters import Motion
from .motion_log import MotionLog
from .sensor_identification import smooth

TORQUE_SHARE, TIMES = 0.9, 2.5
"""The band ends at so many times the frequency below which this share of the torque's power is."""
LEAST_BAND, BAND_SHARE = 1.0, 0.04
"""The lowest band [Hz], and the highest as a share of the log's rate."""
REACH = 1.5
"""Half the low-pass's window, in periods of the band's end."""
MOTION_BAND = 8.0
"""Motion is smoothed at so many times the band: less would smear the friction where a speed turns."""


def band_of(logs: list[MotionLog]) -> float:
    """Return the band [Hz] in which these logs are fitted, by the spectra of their torques, or of a floating base's specific
    force where these were not measured."""
    rate = min(1.0 / log.period for log in logs)
    grid = np.arange(0.1, 0.45 * rate, 0.1)
    power = np.zeros(len(grid))
    for log in logs:
        driving = log.torque if log.base is None or log.torque is not None else log.base[:, 3:]
        assert driving is not None
        torque = driving - driving.mean(axis=0)
        spectrum = (np.abs(np.fft.rfft(torque, axis=0)) ** 2).sum(axis=1) * log.period
        found = np.fft.rfftfreq(len(torque), log.period)
        density = np.interp(grid, found, spectrum) * math.sqrt(len(torque))
        power += density
    below = np.cumsum(power) / max(float(power.sum()), 1e-30)
    edge = float(grid[int(np.searchsorted(below, TORQUE_SHARE))])
    return float(np.clip(TIMES * edge, LEAST_BAND, BAND_SHARE * rate))


@dataclass(frozen=True)
class LowPass:
    """A symmetric low-pass that gives a value for each of some instants.

    Attributes:
        weights: of the samples around an instant (2 reach + 1), whose sum is one; ``slopes`` gives the derivative.
        centres: indices of the instants.
    """

    weights: Array
    slopes: Array
    centres: NDArray[np.int64]

    @classmethod
    def of(cls, count: int, period: float, band: float) -> LowPass:
        """Return that of ``count`` samples; its instants are a third of the band's period apart."""
        reach = max(2, round(REACH / (band * period)))
        k = np.arange(-reach, reach + 1)
        weights = np.sinc(2.0 * band * period * k) * np.hamming(2 * reach + 1)
        weights /= weights.sum()
        slopes = -np.gradient(weights, period)
        slopes -= slopes.mean()
        slopes /= float(slopes @ k) * period
        step = max(1, round(1.0 / (3.0 * band * period)))
        return cls(weights, slopes, np.arange(reach, count - reach, step, dtype=np.int64))

    def __call__(self, values: Array, *, derivative: bool = False, age: float = 0.0) -> Array:
        """Low-pass (n, ...) values of some age [s], or their derivative, at the instants."""
        weights = self.slopes if derivative else self.weights - age * self.slopes
        reach, flat = len(weights) // 2, values.reshape(len(values), -1)
        out = np.empty((len(self.centres), flat.shape[1]))
        for row, centre in enumerate(self.centres.tolist()):
            out[row] = weights @ flat[centre - reach : centre + reach + 1]
        return out.reshape(len(out), *values.shape[1:])


def cutoff_of(log: MotionLog, band: float) -> float:
    """Return the frequency [Hz] below which a log's motion is kept."""
    return min(MOTION_BAND * band, 0.18 / log.period)


def step_of(log: MotionLog, band: float) -> int:
    """Return the samples of a log between two at which equations are formed."""
    return max(1, int(1.0 / (log.period * 6.0 * MOTION_BAND * band)))


def halves(log: MotionLog, band: float) -> tuple[Motion, Motion]:
    """Return the motion by even samples and by odd ones, at every ``step_of``-th sample."""
    return _half(log, band, 0), _half(log, band, 1)


def _half(log: MotionLog, band: float, start: int) -> Motion:
    from scipy.interpolate import CubicSpline

    own = np.arange(start, len(log.position), 2)
    every = np.arange(len(log.position))
    cutoff, step = cutoff_of(log, band), step_of(log, band)

    def whole(values: Array) -> Array:
        return smooth(CubicSpline(own, values[own])(every), log.period, cutoff)

    def slope(values: Array) -> Array:
        return np.asarray(np.gradient(values, log.period, axis=0))

    position = whole(log.position)
    velocity = slope(position)
    joints = position[::step], velocity[::step], slope(velocity)[::step]
    if log.base is None:
        return Motion(*joints)
    base = whole(log.base)
    return Motion(*joints, base[::step, :3], slope(base[:, :3])[::step], base[::step, 3:])


def torque_at(log: MotionLog, band: float) -> Array:
    """Return the torques where ``halves`` has the motion (n, n_joints) [N m], smoothed as the motion is."""
    assert log.torque is not None
    return smooth(log.torque, log.period, cutoff_of(log, band))[:: step_of(log, band)]
