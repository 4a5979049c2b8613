"""``aloft linearise`` on the command line."""

from pathlib import Path

import numpy as np
import pytest
from tests.cli.conftest import run_for_json, run_here

T = 0.01
GRAPH = """
rate: 100 Hz
blocks:
  k: {use: blocks.Gain, with: {gain: -30.0, unit: 1/s}, in: {u: x.y}}
  x: {use: blocks.Integrator, with: {initial: [1.0]}, in: {u: {from: k.y, delay: 1}}}
"""


@pytest.fixture
def loop(tmp_path: Path) -> str:
    (tmp_path / "loop.yaml").write_text(GRAPH)
    return str(tmp_path / "loop.yaml")


def test_margins_of_an_opened_loop_as_json_and_pictures(loop: str, tmp_path: Path) -> None:
    png, svg = tmp_path / "loop.png", tmp_path / "loop.svg"
    drawn = ("--png", str(png), "--svg", str(svg))
    told = run_for_json("linearise", loop, "--input", "k.y", "--open", "--at", "0.1", *drawn)
    assert told["states"] == ["x/u~delay.past.value[0, 0]", "x.x.value[0]"]
    # with one tick of delay the phase is -180 deg where w T = 60 deg, and there |L| = K T
    assert told["margins"]["together"]["gain_up"] == pytest.approx(1.0 / 0.3, rel=1e-2)
    assert told["margins"]["stable"] is True
    assert list(told["margins"]["channels"]) == ["k.y.value[0]"]
    assert png.read_bytes()[:4] == b"\x89PNG"
    assert "phase [deg]" in svg.read_text()


def test_a_model_as_a_table(loop: str) -> None:
    out = run_here(
        "linearise", loop, "--input", "k.y", "--output", "x.y", "--when", "x.y < 0.9"
    ).stdout
    assert "2 states, 1 inputs, 1 outputs, period 10 ms" in out
    assert "slowest poles" in out


def test_a_root_locus_as_json_table_and_picture(loop: str, tmp_path: Path) -> None:
    png, svg = tmp_path / "locus.png", tmp_path / "locus.svg"
    asked = (
        "linearise",
        loop,
        "--input",
        "k.y",
        "--output",
        "x.y",
        "--at",
        "0.1",
        "--locus",
        "k.gain=-50:-150",
    )
    told = run_for_json(*asked, "--steps", "5", "--png", str(png), "--svg", str(svg))
    assert told["values"] == [-50.0, -75.0, -100.0, -125.0, -150.0]
    assert len(told["poles"]) == 5 and len(told["poles"][0]) == 2
    assert told["limits"] == [pytest.approx(-100.0, rel=1e-2)]  # |z|^2 = K T
    assert png.read_bytes()[:4] == b"\x89PNG" and "real part [1/s]" in svg.read_text()
    out = run_here(*asked, "--steps", "4").stdout
    assert "the limit of stability is at -100" in out


@pytest.mark.long
def test_a_response_measured_with_a_chirp_beside_the_model(loop: str, tmp_path: Path) -> None:
    svg = tmp_path / "loop.svg"
    asked = (
        "linearise",
        loop,
        "--input",
        "k.y",
        "--at",
        "0.1",
        "--chirp",
        "1",
        "--band",
        "1:40",
        "--seeds",
        "3:6",
    )
    told = run_for_json(*asked, "--open", "--svg", str(svg))
    (measured,) = told["measured"]
    assert (measured["source"], measured["opened"], measured["samples"]) == (
        "k.y.value[0]",
        True,
        12,
    )
    assert len(measured["frequency_hz"]) == len(measured["coherence"]) == len(measured["within"])
    z = np.exp(2j * np.pi * T * np.array(measured["frequency_hz"]))
    exact = 30.0 * T / (z * (z - 1.0))
    assert np.array(measured["real"]) == pytest.approx(exact.real, rel=1e-3, abs=1e-4)
    assert svg.read_text().count("<use") > len(z)  # points
    out = run_here(*asked, "--output", "x.y").stdout
    assert "k.y.value[0] to x.y.value[0]: 12 periods with a chirp" in " ".join(out.split())
    assert "the model lies within the intervals at" in out


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--input", "k.y", "--open", "--at", "1", "--locus", "k.gain=1:2"], "leave out --open"),
        (["--input", "k.y"], "say about which instant: --at 0.4 or --when"),
        (["--input", "k.y", "--output", "x.y", "--at", "1", "--png", "a.png"], "diagrams show an opened loop"),
        (["--input", "k.y", "--at", "1", "--chirp", "1", "--locus", "k.gain=1:2"], "ask for one of them"),
        (["--input", "k.y", "--at", "1", "--chirp", "1", "--band", "50"], "--band cannot be '50'; write it as --band 1:50"),
        (["--input", "k.y", "--at", "1", "--chirp", "1", "--seeds", "few"], "--seeds cannot be 'few'"),
        (["--input", "k.z", "--at", "1"], "there is no signal 'k.z'"),
    ],
)  # fmt: skip
def test_wrong_questions(loop: str, arguments: list[str], text: str) -> None:
    assert text in run_here("linearise", loop, *arguments, code=2).stderr
