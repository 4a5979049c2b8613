"""Very many mistakes of one kind are printed shortly and counted in full."""

from pathlib import Path
from typing import Any

import pytest

from aloft.runtime.loading import check
from aloft.runtime.loading.checking import infer_units, wire_check


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


def test_a_ring_of_very_many_blocks(tmp_path: Path) -> None:
    lines = [f"  b{k}: {{use: blocks.Gain, in: {{u: b{(k - 1) % 400}.y}}}}" for k in range(400)]
    path = tmp_path / "graph.yaml"
    path.write_text("\n".join(["rate: 100 Hz", "blocks:", *lines]))
    report = check(path)
    (problem,) = report.problems
    assert problem.message.startswith(
        "b0 -> b1 -> b2 -> b3 -> b4 -> b5 -> b6 -> b7 -> (385 more) ->"
    )
    assert "-> b398 -> b399 -> b0 is a loop without a delay" in problem.message
    assert "-> b399.u -> b399.y -> b0.u" in problem.found
    assert problem.fix == "u: {from: b399.y, delay: 1}"
    assert len(report.text()) < 1000


def test_the_work_for_one_missing_block_grows_with_its_readers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = dict.fromkeys(("inferred_outputs", "fits", "nearest"), 0)
    for module, name in (
        (infer_units, "inferred_outputs"),
        (wire_check, "fits"),
        (wire_check, "nearest"),
    ):
        original = getattr(module, name)

        def counted(*given: Any, name: str = name, original: Any = original) -> Any:
            calls[name] += 1
            return original(*given)

        monkeypatch.setattr(module, name, counted)
    count = 100
    lines = [f"  b{k}: {{use: blocks.Gain, in: {{u: nowhere.y}}}}" for k in range(count)]
    path = tmp_path / "graph.yaml"
    path.write_text("\n".join(["rate: 100 Hz", "blocks:", *lines]))
    assert len(check(path).problems) == count
    assert 0 < calls["inferred_outputs"] <= 6 * count  # not count ** 2
    assert 0 < calls["fits"] <= 6 * count
    assert calls["nearest"] == 1
