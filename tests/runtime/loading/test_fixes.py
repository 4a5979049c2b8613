"""The fix that a report proposes is one that a person would choose."""

from pathlib import Path

from aloft.runtime.loading.load import check

TWO_SOURCES = """\
rate: 100 Hz
blocks:
  ref: {use: blocks.SineWave}
  other: {use: blocks.SineWave}
  sum: {use: blocks.Sum, in: {a: ref.y}}
"""


def test_a_second_input_is_not_offered_the_source_of_the_first(tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(TWO_SOURCES)
    (problem,) = check(file).problems
    assert problem.at == "sum.b"
    assert problem.fix == "in: {b: other.y}"
