"""Root loci against closed forms."""

from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

import aloft
from aloft.extensions.analysis import root_locus
from aloft.extensions.analysis.locus import locus_figure

T = 0.01
LOOP = dedent("""
    rate: 100 Hz
    blocks:
      k: {use: blocks.Gain, with: {gain: -30.0, unit: 1/s}, in: {u: x.y}}
      x: {use: blocks.Integrator, with: {initial: [1.0]}, in: {u: {from: k.y, delay: 1}}}
""")


@pytest.fixture
def loop(tmp_path: Path) -> Path:
    (tmp_path / "loop.yaml").write_text(LOOP)
    return tmp_path / "loop.yaml"


def test_the_poles_of_an_integrator_with_a_delay_are_the_roots_of_its_polynomial(
    loop: Path,
) -> None:
    found = root_locus(loop, "k.gain=-10:-150", inputs="k.y", outputs="x.y", steps=29, at=0.1)
    assert found.poles.shape == (29, 2)
    for gain, poles in zip(found.values, found.poles, strict=True):
        expected = np.sort_complex(np.roots([1.0, -1.0, -gain * T]))  # z^2 - z + K T = 0
        assert np.allclose(np.sort_complex(poles), expected, atol=1e-7)
    # |z|^2 = K T of the pair: it is unstable from K T = 1 on
    assert found.limits == pytest.approx((-100.0,), rel=1e-3)
    # a traced pole moves little from value to value, but where the pair meets on the real axis
    assert np.abs(np.diff(found.poles, axis=0)).max() < 0.3
    assert np.allclose(np.exp(found.continuous * T), found.poles)
    assert np.abs(found.leading) == pytest.approx(np.abs(found.poles).max(axis=1))
    drawn = locus_figure(found, "loop").axes[0]
    assert "k.gain from -10 (o) to -150 (x)" in drawn.get_xlabel()


def test_what_drifts_is_no_limit(tmp_path: Path) -> None:
    text = (
        LOOP + "  d: {use: blocks.Integrator, in: {u: x.y}}\n"
    )  # a pole at 1, whatever the gain is
    (tmp_path / "drifting.yaml").write_text(text)
    found = root_locus(
        tmp_path / "drifting.yaml", "k.gain=-10:-90", inputs="k.y", outputs="d.y", steps=3, at=0.1
    )
    assert np.abs(found.poles).max(axis=1) == pytest.approx(1.0, abs=1e-6)
    assert found.limits == ()
    expected = [max(abs(np.roots([1.0, -1.0, -gain * T]))) for gain in found.values]
    assert np.abs(found.leading) == pytest.approx(expected, abs=1e-6)


def test_a_parameter_with_a_unit(tmp_path: Path) -> None:
    text = LOOP.replace("{from: k.y, delay: 1}", "f.y") + (
        "  f: {use: blocks.LowPass, with: {cutoff: 5 Hz, order: 1, unit: 1/s}, in: {u: k.y}}\n"
    )
    text = text.replace(", unit: 1/s}, in: {u: k.y}}\n", "}, in: {u: k.y}}\n")
    (tmp_path / "filtered.yaml").write_text(text)
    found = root_locus(
        tmp_path / "filtered.yaml", "f.cutoff=1 Hz:20 Hz", inputs="k.y", outputs="x.y", steps=4, at=0.1
    )  # fmt: skip
    assert found.unit == "Hz"
    slow = found.continuous[0]
    # s^2 / w + s + K = 0 with w = 2 pi: the pair has the real part -w / 2, but for the sampling
    assert slow.real.max() == pytest.approx(-np.pi, abs=0.5)


@pytest.mark.parametrize(
    ("over", "text"),
    [
        ("k.gain", "is no range of a parameter; write block.parameter=1:10"),
        ("k.gain=1 ms:8 s", "is no range of a parameter"),
        ("k.gain=a:b", "is no range of a parameter"),
        ("k.gone=1:2", "no parameter 'gone'"),
    ],
)
def test_what_cannot_be_asked_is_said(loop: Path, over: str, text: str) -> None:
    with pytest.raises(aloft.AloftError, match=text):
        root_locus(loop, over, inputs="k.y", outputs="x.y", at=0.1)
