"""Faults on wires: what each kind does, when, and what is said of those that cannot be."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aloft
from aloft.extensions.studio.diagram.diagram import subgraphs
from aloft.files.problems import LoadError
from aloft.logs.replay.replay import KeptRun, Keyframes, replay
from aloft.runtime.language.signal_error import chirp_lines
from aloft.runtime.loading.picture import table
from aloft.runtime.running.run_result import RunResult

TEXT = """
rate: 100 Hz
duration: 1 s
blocks:
  r: {use: blocks.Ramp, with: {n: 2, slope: [1.0, 2.0]}}
  x: {use: blocks.Gain, with: {n: 2, gain: 1.0}, in: {u: r.y}}
  z: {use: blocks.Gain, with: {gain: 1.0}, in: {u: "r.y.value[1]"}}
"""
TIME = np.arange(100) / 100.0
RAMP = np.stack([TIME, 2.0 * TIME], axis=1)


def loaded(tmp_path: Path, **faults: str) -> aloft.Graph:
    path = tmp_path / "graph.yaml"
    entries = "".join(f"  {name}: {{{text}}}\n" for name, text in faults.items())
    path.write_text(f"{TEXT}faults:\n{entries}")
    return aloft.load(path)


def run(tmp_path: Path, **faults: str) -> RunResult:
    return loaded(tmp_path, **faults).run()


def expected(rows: slice | np.ndarray, values: Any) -> np.ndarray:
    """The ramp with other values of its second element."""
    changed = RAMP.copy()
    changed[rows, 1] = values
    return changed


FROM_HALF = slice(50, None)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("kind: stuck, start: 0.5 s", expected(FROM_HALF, RAMP[49, 1])),
        ("kind: stuck, value: 7, start: 0.5 s, duration: 0.1 s", expected(slice(50, 60), 7.0)),
        ("kind: delayed, delay: 50 ms, start: 0.5 s", expected(FROM_HALF, RAMP[45:95, 1])),
        ("kind: delayed, delay: 20 ms", expected(slice(None), np.maximum(0.0, 2.0 * (TIME - 0.02)))),
        ("kind: biased, value: 3, start: 500 ms", expected(FROM_HALF, RAMP[50:, 1] + 3.0)),
        ("kind: drifting, value: 3, time: 0.1 s, start: 0.5 s",
         expected(FROM_HALF, RAMP[50:, 1] + 30.0 * (TIME[50:] - 0.5))),
        ("kind: scaled, factor: -0.5", expected(slice(None), -0.5 * RAMP[:, 1])),
        ("kind: flipped, bit: 63, start: 0.5 s", expected(FROM_HALF, -RAMP[50:, 1])),  # the sign
        ("kind: biased, value: 1, when: z.y > 0.999, start: 0.1 s",
         expected(slice(61, None), RAMP[61:, 1] + 1.0)),  # seen in the next tick
        ("kind: biased, value: 1, when: z.y > 5", RAMP),
    ],
)  # fmt: skip
def test_each_kind(tmp_path: Path, text: str, values: np.ndarray) -> None:
    done = run(tmp_path, f=f'on: "r.y.value[1]", {text}')
    assert done.success, done.reason
    assert done.signal("x.y.value") == pytest.approx(values, abs=1e-12)
    assert done.signal("r.y.value") == pytest.approx(RAMP, abs=1e-12)  # the source is as it was
    assert np.array_equal(done.signal("z.y.value")[:, 0], done.signal("x.y.value")[:, 1])
    different = np.abs(done.signal("x.y.value") - done.signal("r.y.value")).max(axis=1) > 0
    assert not different[~done.signal("faults/f.state.active")].any()


def test_what_is_drawn(tmp_path: Path) -> None:
    lost = run(tmp_path, f='on: "r.y", kind: lost, share: 0.3').signal("x.y.value")
    repeats = (np.diff(lost, axis=0) == 0.0).all(axis=1)
    assert 15 <= repeats.sum() <= 45  # of 99; 30 are expected, and the standard deviation is 4.6
    noise = (
        run(tmp_path, f='on: "r.y.value[1]", kind: noisy, value: 0.1').signal("x.y.value") - RAMP
    )
    assert noise[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert 0.08 < noise[:, 1].std() < 0.12
    late = run(tmp_path, f='on: "r.y.value[1]", kind: biased, value: 1, start_spread: 1 s')
    begin = [int(np.argmax(late.signal("faults/f.state.active")))]
    graph = loaded(tmp_path, f='on: "r.y.value[1]", kind: biased, value: 1, start_spread: 1 s')
    assert graph.seed_parameters == ("faults.f.seed",)
    begin += [
        int(np.argmax(graph.run(seed=seed).signal("faults/f.state.active"))) for seed in (1, 2)
    ]
    assert len(set(begin)) == 3


def test_a_chirp_has_its_lines_its_size_and_its_period(tmp_path: Path) -> None:
    text = 'on: "r.y.value[1]", kind: chirp, value: 3, low: 4 Hz, high: 40 Hz, time: 0.25 s, start: 0.25 s'
    added = run(tmp_path, f=text).signal("x.y.value") - RAMP
    assert added[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert added[:25, 1] == pytest.approx(0.0, abs=1e-12)
    one, two, three = added[25:, 1].reshape(3, 25)
    assert two == pytest.approx(one, abs=1e-9) and three == pytest.approx(one, abs=1e-9)
    assert np.sqrt(np.mean(one**2)) == pytest.approx(3.0)
    lines = np.abs(np.fft.rfft(one)) / 25
    assert lines[1:11] == pytest.approx(lines[1]) and lines[[0, 11, 12]] == pytest.approx(
        0.0, abs=1e-9
    )  # 4 to 40 Hz
    assert np.abs(one).max() < 3.0 * np.sqrt(2.0) * 1.7  # flat: ten sines in phase have 4.5
    assert np.array_equal(chirp_lines(1.0, 4.0, 2.0), np.arange(2, 9) / 2)
    many = chirp_lines(0.1, 100.0, 10.0)
    assert (len(many), many[0], many[-1]) == (35, 0.1, 100.0)


def test_on_one_input_the_others_read_what_is_written(tmp_path: Path) -> None:
    done = run(tmp_path, f='on: "x.u.value[1]", kind: stuck, value: 7')
    assert (done.signal("x.y.value")[:, 1] == 7.0).all()
    assert np.array_equal(done.signal("z.y.value")[:, 0], done.signal("r.y.value")[:, 1])


def test_several_on_one_wire_act_in_their_order(tmp_path: Path) -> None:
    done = run(
        tmp_path,
        a='on: "r.y.value[1]", kind: biased, value: 1',
        b='on: "r.y.value[1]", kind: scaled, factor: 2',
        c='on: "x.u.value[1]", kind: biased, value: 10',
    )
    assert done.signal("x.y.value")[:, 1] == pytest.approx(2.0 * (RAMP[:, 1] + 1.0) + 10.0)
    assert done.signal("z.y.value")[:, 0] == pytest.approx(2.0 * (RAMP[:, 1] + 1.0))


ALL = {
    "a": 'on: "r.y", kind: lost, share: 0.3, start: 0.2 s',
    "b": 'on: "r.y.value[0]", kind: noisy, value: 0.1, when: z.y > 0.6',
    "c": 'on: "x.u.value[1]", kind: flipped, bit: 3, share: 0.5',
    "d": 'on: "r.y.value", kind: delayed, delay: 30 ms, start: 0.4 s',
}


def test_runs_repeat_themselves_in_every_tier_and_from_a_snapshot(tmp_path: Path) -> None:
    graph = loaded(tmp_path, **ALL)
    keyframes = Keyframes(37)
    done = graph.run(sinks=[keyframes], log=True)
    assert done.success, done.reason
    assert graph.run(plain=True).run_hash == done.run_hash
    assert graph.run(fuse=False).run_hash == done.run_hash
    again = replay(KeptRun.of(done, keyframes), first_tick=40, inputs="seed")
    assert again.first_tick == 37
    assert again.identical
    text = graph.checked.text  # what a recording keeps
    assert aloft.load(text, path=tmp_path / "graph.yaml").run().run_hash == done.run_hash


def test_it_is_seen_in_the_table_and_the_diagram(tmp_path: Path) -> None:
    graph = loaded(tmp_path, f='on: "r.y.value[1]", kind: stuck').checked
    row = next(row for row in table(graph) if row.path == "faults/f")
    assert row.use == "stuck: r.y.value[1]"
    assert row.inputs[0].source == "r.y"
    assert subgraphs(graph) == ("faults",)
    assert {wire.source for spec in graph.blocks for wire in spec.wires.values()} >= {"faults/f.y"}


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ('kind: stuck', "missing-key", "the fault does not say where it is"),
        ('on: r.y', "missing-key", "the fault has no kind"),
        ('on: r.y, kind: stuk', "bad-value", "'stuk' is no kind of fault"),
        ('on: r.y.value, kind: biased', "missing-key", "a fault that is biased needs 'value'"),
        ('on: r.y.value, kind: biased, value: 1, bit: 3', "unknown-key",
         "'bit' is not a key of a fault that is biased"),
        ('on: q.y, kind: stuck', "unknown-source", "faults.f is on q.y, which is neither an output nor an input"),
        ('on: r.v, kind: stuck', "unknown-source", "faults.f is on r.v, which is neither an output nor an input"),
        ('on: r.y.valu, kind: stuck', "bad-value", "Vector has no field 'valu'"),
        ('on: "r.y.value[5]", kind: stuck', "bad-value", "is outside of 2 elements"),
        ('on: z.u, kind: stuck', "bad-value", "faults.f is on the input z.u, which is composed of parts"),
        ('on: [r.y.value, x.y.value], kind: stuck', "bad-value", "faults.f is on several signals"),
        ('on: r.y.value, kind: biased, value: 1 m', "unit", "faults.f.value"),
        ('on: r.y.value, kind: lost, share: 2', "bad-parameter", "faults.f.share"),
        ('on: r.y.value, kind: delayed, delay: 1 ms', "bad-value", "faults.f.delay is below half a period of r.y"),
        ('on: r.y.value, kind: chirp, value: 1, low: 1 Hz', "missing-key", "a fault that is chirp needs 'high'"),
        ('on: r.y.value, kind: chirp, value: 1, low: 1.1 Hz, high: 1.9 Hz', "bad-value",
         "faults.f has no frequency: none from low to high is a multiple of 1 / time"),
        ('on: r.y.value, kind: chirp, value: 1, low: 1 Hz, high: 50 Hz', "bad-value", "faults.f.high cannot be 50 Hz"),
        ('on: r.y.value, kind: flipped, bit: 99', "bad-parameter", "faults.f.bit"),
        ('on: r.y, kind: stuck, when: now', "bad-value", "'now' is no condition"),
        ('on: r.y, kind: stuck, when: z.v > 1', "unknown-source", "faults.f waits for z.v"),
        ('on: r.y, kind: stuck, when: r.y.value > 1', "bad-value", "compares no number"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said(tmp_path: Path, text: str, code: str, message: str) -> None:
    with pytest.raises(LoadError) as raised:
        loaded(tmp_path, f=text)
    problems = raised.value.report.problems
    assert [problem.code for problem in problems] == [code]
    assert message in problems[0].message
    assert problems[0].where.line > len(TEXT.splitlines())


def test_on_a_robot() -> None:
    settings = {
        "faults.switch": {"on": "robot.contacts.closed[left_toe]", "kind": "stuck", "value": False},
        "faults.knee": {"on": ["robot.command.torque[left_knee]", "robot.command.stiffness[left_knee]"],
                        "kind": "scaled", "factor": 0.0, "when": "phase.phase == FLIGHT"},
    }  # fmt: skip
    graph = aloft.load("graphs/jump.yaml", settings).checked
    assert graph.block("contacts").wires["switches"].source == "faults/switch.y"
    assert graph.block("robot").wires["command"].source == "faults/knee.y"
    with pytest.raises(LoadError, match="which only a simulator knows"):
        aloft.load("graphs/jump.yaml", {"faults.f": {"on": "robot.truth.com", "kind": "stuck"}})
    with pytest.raises(LoadError, match="cannot be biased"):
        aloft.load("graphs/jump.yaml", {"faults.f": {"on": "robot.contacts.closed", "kind": "biased", "value": 1}})  # fmt: skip
