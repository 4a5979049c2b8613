"""Quaternions in general vectors are the identity before their first value."""

from pathlib import Path

import numpy as np
import pytest

from aloft.runtime.graph import load

HEAD = """
rate: 100 Hz
duration: 0.1 s
blocks:
  angles: {use: blocks.Constant, with: {value: [0.2 rad, -0.1 rad, 1.0 rad]}}
  q: {use: blocks.EulerToQuaternion, in: {u: angles.y}}
  rows:
    use: blocks.TablePlayback
    rate: 25 Hz
    offset: 3
    with: {columns: [x, y, z, w], rows: [[0, 0, 0, 0.6, 0.8], [1, 0, 0, 0.6, 0.8]]}
  slow: {use: blocks.ZeroOrderHold, in: {u: q.y}, rate: 25 Hz, offset: 2}
  never: {use: blocks.Compare, with: {operation: "<"}, in: {a: {value: {value: 1}}, b: {value: {value: 0}}}}
"""
PRODUCT = (
    "  p: {{use: blocks.QuaternionProduct, in: {{a: {}, b: {{value: {{value: [0, 0, 0, 1]}}}}}}}}\n"
)


@pytest.mark.parametrize(
    ("block", "read", "ticks"),
    [
        ("{use: blocks.Delay, with: {samples: 3}, in: {u: q.y}}", "d.y", 3),
        ("{use: blocks.UnitDelay, in: {u: q.y}}", "d.y", 1),
        ("{use: blocks.UnitDelay, in: {u: slow.y}}", "d.y", 3),
        ("{use: blocks.UnitDelay, in: {u: rows.y}}", "d.y", 4),
        ("{use: blocks.UnitDelay, in: {u: q.y}}", "{from: d.y, delay: 2}", 3),
        ("{use: blocks.UnitDelay, in: {u: q.y}}", "{from: d.y.value, delay: 2}", 3),
        ("{use: blocks.UnitDelay, in: {u: q.y}}", "'d.y.value[0:4]'", 1),
        ("{use: blocks.SampleHold, in: {u: q.y, trigger: 'never.y.value[0]'}}", "d.y", 10),
        ("{use: blocks.Gain, in: {u: q.y}, rate: 25 Hz, offset: 2}", "d.y", 2),
        ("{use: blocks.Gain, in: {u: q.y}, rate: 25 Hz, offset: 2}", "'d.y.value[0:4]'", 2),
        ("{use: blocks.Gain, in: {u: q.y}, rate: 25 Hz, offset: 2}", "{from: d.y, delay: 1}", 6),
    ],
)  # fmt: skip
def test_no_turn_before_the_first_value(tmp_path: Path, block: str, read: str, ticks: int) -> None:
    text = f"{HEAD}  d: {block}\n{PRODUCT.format(read)}"
    y = load(text, path=tmp_path / "graph.yaml").run().signal("p.y.value")
    assert y[:ticks].tolist() == [[0.0, 0.0, 0.0, 1.0]] * ticks
    np.testing.assert_allclose(np.linalg.norm(y, axis=1), 1.0, atol=1e-12)
    assert ticks >= len(y) or abs(y[ticks, 3]) < 0.95


@pytest.mark.parametrize("initial", ["0", "[0, 0, 1, 0]"])
def test_an_initial_value_that_is_given_is_taken(tmp_path: Path, initial: str) -> None:
    block = f"{{use: blocks.UnitDelay, with: {{initial: {initial}}}, in: {{u: q.y}}}}"
    text = f"{HEAD}  d: {block}\n{PRODUCT.format('d.y')}"
    y = load(text, path=tmp_path / "graph.yaml").run().signal("p.y.value")
    assert y[0].tolist() == ([0.0] * 4 if initial == "0" else [0.0, 0.0, 1.0, 0.0])


def test_four_numbers_that_are_no_quaternion_begin_at_zero(tmp_path: Path) -> None:
    text = f"{HEAD}  c: {{use: blocks.Constant, with: {{value: [1, 2, 3, 4]}}}}\n"
    text += (
        "  d: {use: blocks.UnitDelay, in: {u: c.y}}\n  g: {use: blocks.UnitDelay, in: {u: d.y}}\n"
    )
    result = load(text, path=tmp_path / "graph.yaml").run()
    assert result.signal("g.y.value")[:3].tolist() == [[0.0] * 4, [0.0] * 4, [1.0, 2.0, 3.0, 4.0]]
