"""A recorded stretch checks a block to the last bit, or within tolerances."""

from pathlib import Path

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.integrators_and_delays import UnitDelay
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.testing.stretch import Setting, Stretch, StretchError


class Number(Signal):
    value = Field(text="a number")


class Count(Block):
    """Counts from five."""

    y = Output(Number, text="the count")

    def step(self) -> None:
        self.y.value[()] = self.tick + 5.0


RNG = np.random.default_rng(0)
INPUT = RNG.standard_normal((5, 2))
SETTING = Setting(500.0, 1, {"n": 2}, ("u",))


def gain(**changes: object) -> Stretch:
    parts = {
        "ticks": np.arange(40, 45), "inputs": {"u.value": INPUT},
        "outputs": {"y.value": 3.0 * INPUT}, "setting": SETTING, **changes,
    }  # fmt: skip
    return Stretch(**parts)  # type: ignore[arg-type]


def test_the_same_bits_or_the_place_that_differs() -> None:
    gain().check(Gain, {"n": 2, "gain": 3.0})
    wrong = 3.0 * INPUT
    wrong[2, 1] = np.nextafter(wrong[2, 1], np.inf)
    with pytest.raises(StretchError, match=r"tick 42: y\.value\[1\] is .* was .*, 1 ULP apart$"):
        gain(outputs={"y.value": wrong}).check(Gain, {"n": 2, "gain": 3.0})
    gain(outputs={"y.value": wrong}).check(Gain, {"n": 2, "gain": 3.0}, rtol=1e-15)
    with pytest.raises(StretchError, match=r"tick 40: y\.value\[0\].*1 more elements"):
        gain(outputs={"y.value": wrong + 1e-3}).check(Gain, {"n": 2, "gain": 3.0}, atol=1e-4)


def test_state_ticks_and_live_changes(tmp_path: Path) -> None:
    late = Stretch(
        SETTING, np.arange(40, 45), {"x.value": np.array([7.0, 8.0])}, {}, {"u.value": INPUT},
        {"y.value": np.vstack([[7.0, 8.0], INPUT[:-1]])},
    )  # fmt: skip
    late.write(tmp_path / "late.npz")
    read = Stretch.read(tmp_path / "late.npz")
    assert read.setting == SETTING
    read.check(UnitDelay, {"n": 2})
    factor = np.array([[3.0], [3.0], [5.0], [5.0], [5.0]])
    setting = Setting(500.0, 1, {"n": 2}, ("u",), changes=((42, "gain", 5.0),))
    changed = gain(setting=setting, outputs={"y.value": factor * INPUT})
    changed.write(tmp_path / "gain.npz")
    Stretch.read(tmp_path / "gain.npz").check(Gain, {"n": 2, "gain": 3.0})


def test_a_shape_that_has_changed() -> None:
    with pytest.raises(StretchError, match=r"y\.value has shape \(2,\), expected \(3,\)"):
        gain(outputs={"y.value": np.zeros((5, 3))}).check(Gain, {"n": 2})


def test_a_scalar_output() -> None:
    found = Stretch(
        Setting(500.0, 1, {}, ()), np.arange(2), {}, {}, {}, {"y.value": np.array([5.0, 6.5])}
    )
    with pytest.raises(StretchError, match=r"tick 1: y\.value is 6\.0, recorded was 6\.5, "):
        found.check(Count, {})
