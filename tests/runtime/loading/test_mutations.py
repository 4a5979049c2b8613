"""Whatever is done to a graph file, loading ends with a graph or a report, never with a crash."""

import tempfile
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.runtime.loading import LoadError, check, checked_file

GRAPH = """\
rate: 100 Hz
duration: 50 ms
robot: bruce
dimensions: {m: 3}
clock: {kind: paced, overrun: stop, stop_after: 2}
include: [more.yaml]
_gain: &gain {gain: 2.0, n: 2}
blocks:
  one: {use: blocks.Constant, with: {value: [1.0, -2.0]}}
  wave: {use: blocks.SineWave, with: {n: 2, frequency: 2 Hz, phase: 90 deg}, rate: 50 Hz}
  gain: {use: blocks.Gain, with: {<<: *gain, gain: 1e-3}, in: {u: leg.y}}
  leg: {use: leg.yaml, with: {gain: 3.0}, in: {u: {from: gain.y, delay: 2, initial: {value: 1}}}}
  sum:
    use: blocks.Sum
    with: {n: 2, weights: [1.0, -1.0]}
    in: {a: one.y, b: {from: wave.y}}
    rate: 25 Hz
    offset: 1
wires: {more.u: leg/inner.y}
set: {more.gain: 4, leg/inner.n: 2}
"""
LEG = """\
inputs: {u: , spare: optional}
outputs: {y: inner.y}
parameters: {gain: 1.0}
blocks:
  inner: {use: blocks.Gain, with: {gain: $gain, n: 2}, in: {u: inputs.u}}
  second: {use: blocks.UnitDelay, with: {n: 2}, in: {u: inputs.u}}
  third: {use: blocks.UnitDelay, with: {n: 2}, in: {u: second.y}, rate: 50 Hz}
"""
MORE = "blocks: {more: {use: blocks.Gain, with: {n: 2}, in: {u: one.y}}}\n"
PIECES = (
    "{", "}", "[", "]", ": ", ", ", "\n", "\n  ", "- ", "&a ", "*a", "*gain", "<<: ", "!x ", "# ",
    "'", '"', "\t", "null", "true", "-1", "0", "1e400", "1e-3", ".nan", "99999999999999999999",
    "one.y", "leg.y", "leg", "inputs.u", "$gain", "$$", "leg.yaml", "graph.yaml", "in: ", "with: ",
    "use: ", "delay: 1", "value: ", "blocks.Sum", "blocks.", "no_such:Block", "os:path", "../", "é", "\x07",
)  # fmt: skip


@cache
def folder() -> Path:
    return Path(tempfile.mkdtemp(prefix="aloft-mutations-"))


def survives(graph: str, leg: str, more: str, overrides: list[str]) -> None:
    path = folder() / "graph.yaml"
    for name, text in (("graph", graph), ("leg", leg), ("more", more)):
        (folder() / f"{name}.yaml").write_text(text, encoding="utf-8")
    report = check(path, overrides)
    assert report.text()
    assert report.as_json()["count"] == len(report.problems)
    try:
        loaded = checked_file(path, overrides)
    except LoadError:
        assert not report.ok
    else:
        assert report.ok
        assert len(loaded.order) == len(loaded.blocks)


def without_spare(text: str) -> str:
    return text.replace(", spare: optional", "")


def test_the_graph_is_good_before_it_is_mutated() -> None:
    survives(GRAPH, without_spare(LEG), MORE, [])
    assert check(folder() / "graph.yaml").ok


@st.composite
def mutated(draw: st.DrawFn, text: str, pieces: tuple[str, ...] = PIECES) -> str:
    for _ in range(draw(st.integers(0, 3))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        kind = draw(st.sampled_from(["delete", "insert", "replace", "copy", "lines"]))
        if kind == "delete":
            text = text[:start] + text[end:]
        elif kind == "insert":
            text = text[:start] + draw(st.sampled_from(pieces)) + text[start:]
        elif kind == "replace":
            text = text[:start] + draw(st.sampled_from(pieces)) + text[end:]
        elif kind == "copy":
            to = draw(st.integers(0, len(text)))
            text = text[:to] + text[start:end] + text[to:]
        else:
            lines = text.splitlines(keepends=True) or [""]
            i, j = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
            lines[i], lines[j] = lines[j], lines[i]
            text = "".join(lines)
    return text


@pytest.mark.long
@settings(max_examples=400, deadline=None)
@given(mutated(GRAPH), mutated(without_spare(LEG)), mutated(MORE))
def test_mutated_files(graph: str, leg: str, more: str) -> None:
    survives(graph, leg, more, [])


@settings(max_examples=60, deadline=None)
@given(st.lists(mutated("leg.gain=3 | gain.n=2 | rate=10 Hz"), max_size=2))
def test_mutated_overrides(texts: list[str]) -> None:
    survives(GRAPH, LEG, MORE, [part for text in texts for part in text.split(" | ")])


@pytest.mark.parametrize("path", ["blocks", "rate", "include", "set", "wires", "clock", "robot"])
@pytest.mark.parametrize("value", ["", "3", "text", "[]", "[1]", "{a: b}", "{a: {b: c}}", "true"])
def test_every_key_with_every_kind(path: str, value: str) -> None:
    lines = [line for line in GRAPH.splitlines() if not line.startswith(path)]
    if path == "blocks":
        lines = lines[:6]
    survives("\n".join([*lines, f"{path}: {value}"]), LEG, MORE, [])
