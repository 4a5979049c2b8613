"""The offset of a use counts for the blocks inside it, whatever their rates."""

from pathlib import Path

from aloft.runtime.loading import checked_file

INNER = """\
inputs: {u: }
outputs: {y: slow.y}
blocks:
  fast: {use: blocks.Gain, rate: 50 Hz, with: {gain: 2}, in: {u: inputs.u}}
  slow: {use: blocks.Gain, with: {gain: 2}, in: {u: fast.y}}
"""
OUTER = """\
rate: 100 Hz
blocks:
  ref: {use: blocks.SineWave}
  part: {use: inner.yaml, rate: 10 Hz, offset: 5, in: {u: ref.y}}
"""


def test_an_offset_is_wrapped_into_the_period_of_a_faster_inner_block(tmp_path: Path) -> None:
    (tmp_path / "inner.yaml").write_text(INNER)
    (tmp_path / "outer.yaml").write_text(OUTER)
    graph = checked_file(tmp_path / "outer.yaml")
    found = {
        spec.path: (spec.period_ticks, spec.offset_ticks)
        for spec in graph.blocks
        if spec.path.startswith("part/")
    }
    assert found == {"part/fast": (2, 1), "part/slow": (10, 5)}
