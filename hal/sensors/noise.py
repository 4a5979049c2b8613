"""The errors of any sensor: bias, white noise, saturation, rounding and delay, drawn from the seed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Indices1D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.random_stream import normal_call


class NoiseModel(Parameters):
    """The errors of one field of a sensor, in the unit of the field; none by default.

    A reading is ``round(clip(true + bias + noise))``, late by ``delay``.
    """

    noise: float = parameter(0.0, ge=0, text="standard deviation of white noise, a draw a sample")
    bias: float = parameter(
        0.0, ge=0, text="spread of the bias: half the width of a uniform distribution, drawn once"
    )
    range: float | None = parameter(
        None, gt=0, text="readings saturate at plus and minus this; none: never"
    )
    resolution: float = parameter(
        0.0, ge=0, text="readings are rounded to multiples of this; 0: not rounded"
    )
    delay: float = parameter(
        0.0, unit="s", ge=0, le=0.1, text="age of a reading, rounded up to whole samples"
    )

    def scaled(self, factor: float) -> NoiseModel:
        """Return the model with ``factor`` times the noise and the bias; 0: no errors of any kind."""
        if factor == 0.0:
            return NoiseModel()
        return self.model_copy(update={"noise": factor * self.noise, "bias": factor * self.bias})


class Errors(NamedTuple):
    """The errors of ``n`` numbers.

    ``bias`` (n,) is added where ``biased``; ``draws`` (n,) are of variance one and ``noise`` (n,)
    scales them; ``limit`` (n,) is the range and ``resolution`` (n,) the step of rounding, zero for none.
    """

    biased: bool
    bias: Array1D
    draws: Array1D
    noise: Array1D
    limit: Array1D
    resolution: Array1D


@kernel
def add_errors(true: Array1D, errors: Errors, reading: Array1D) -> None:
    """Write the ``reading`` (n,) of the ``true`` values (n,); what is not a number stays so."""
    for k in range(reading.shape[0]):
        value = true[k]
        if errors.biased:
            value += errors.bias[k]
        if errors.noise[k] != 0.0:
            value += errors.draws[k] * errors.noise[k]
        value = min(value, errors.limit[k])
        value = max(value, -errors.limit[k])
        step = errors.resolution[k]
        if step != 0.0:
            value = np.rint(value / step) * step
        reading[k] = value


class FieldErrors:
    """The errors of one field: what was drawn from the seed, and the call that adds them.

    Args:
        model: the sizes of the errors.
        size: how many numbers the field has.
        bias_stream: the random stream of the bias, drawn from once, here.
        noise_stream: the random stream of the noise, drawn from in every sample.
        biased: whether a bias is added at all; a bias of zero turns -0.0 into 0.0.

    Attributes:
        bias: the drawn bias, (size,).
    """

    def __init__(
        self,
        model: NoiseModel,
        size: int,
        bias_stream: np.random.Generator | None,
        noise_stream: np.random.Generator | None,
        biased: bool = True,
    ) -> None:
        self.bias = np.zeros(size)
        if bias_stream is not None:
            self.bias = bias_stream.uniform(-1.0, 1.0, size) * model.bias
        self._noise_stream = noise_stream if model.noise else None
        limit = math.inf if model.range is None else model.range
        self.arrays = Errors(
            biased, self.bias, np.zeros(size), np.full(size, model.noise), np.full(size, limit),
            np.full(size, model.resolution),
        )  # fmt: skip

    def calls(self, true: Array, reading: Array) -> list[Call]:
        """Write the ``reading`` of a sample of ``true`` values, both (size,)."""
        return [*self.draw_calls(), KernelCall(add_errors, true, self.arrays, reading)]

    def draw_calls(self) -> list[Call]:
        """Draw the noise of a sample."""
        if self._noise_stream is None:
            return []
        return [normal_call(self._noise_stream, self.arrays.draws)]


@kernel
def delay_sample(
    sample: Array1D, ring: Array2D, taken: Indices1D, delay: Indices1D, reading: Array1D
) -> None:
    """Put a ``sample`` (n,) into a ring of past ones, and write the ``reading`` (n,) that is late; before the first
    samples it is the first one.

    Args:
        ring: past samples, (slots, n), of which slot ``taken % slots`` is written next.
        taken: how many samples were taken, (1,).
        delay: how many samples each number is late, (n,).
    """
    slots, count = ring.shape[0], taken[0]
    ring[count % slots, :] = sample
    for k in range(sample.shape[0]):
        late = min(delay[k], count)
        reading[k] = ring[(count - late) % slots, k]
    taken[0] = count + 1
