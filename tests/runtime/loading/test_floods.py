"""Very many mistakes of one kind are printed shortly and counted in full."""

from pathlib import Path

from aloft.runtime.loading import check


def test_one_missing_block_read_by_many(tmp_path: Path) -> None:
    lines = [f"  b{k}: {{use: blocks.Gain, in: {{u: nowhere.y}}}}" for k in range(60)]
    path = tmp_path / "graph.yaml"
    path.write_text("\n".join(["rate: 100 Hz", "blocks:", *lines]))
    report = check(path)
    assert len(report.problems) == 60
    for text in (report.text(), report.rich().plain):
        assert text.count("there is no block 'nowhere'") == 20
        assert "40 more problems of the kind unknown-source; --json has all of them" in text
        assert text.endswith("graph.yaml: 60 problems")
