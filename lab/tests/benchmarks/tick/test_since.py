"""The controller of an earlier commit."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from aloft.lab.benchmarks import earlier_build
from aloft.lab.benchmarks.tick.programs import COMPILED, FUSED, earlier_rows
from aloft.lab.benchmarks.tick.tick import EarlierController
from aloft.runtime.language.errors import AloftError

GIT = ("git", "-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
MAIN = """
import json, sys
print(json.dumps({"blocks": {"wbc": {"p50_us": 7.0}, "robot": {"p50_us": 9.0}}, "argv": sys.argv}))
"""


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "__init__.py").touch()
    (tmp_path / "__main__.py").write_text(MAIN)
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "first"]):
        subprocess.run([*GIT, *words], cwd=tmp_path, check=True)
    monkeypatch.setattr(earlier_build, "ROOT", tmp_path)
    return tmp_path


def test_the_earlier_sources_run_and_the_robot_does_not_count(repository: Path) -> None:
    (repository / "__main__.py").write_text("raise SystemExit('the present sources')")
    earlier = EarlierController("HEAD")
    assert earlier.run() == {"wbc": 7.0}
    earlier.close()


def test_a_run_that_fails_is_said(repository: Path) -> None:
    (repository / "__main__.py").write_text("raise SystemExit('no such plan')")
    subprocess.run([*GIT, "commit", "-qam", "second"], cwd=repository, check=True)
    with pytest.raises(AssertionError, match="the jump of HEAD failed: no such plan"):
        EarlierController("HEAD").run()


def test_an_unknown_commit_is_said(repository: Path, tmp_path: Path) -> None:
    with pytest.raises(AloftError, match=r"the sources of 123abc are not at hand: .*history"):
        EarlierController("123abc")


def test_the_rows_compare_round_by_round() -> None:
    times = {COMPILED: np.full(6, 10.0), FUSED: np.array([4.0, 4, 4, 8, 8, 8])}
    before = [{"wbc": 60.0, "legs": 20.0}, {"wbc": 100.0, "legs": 60.0}]
    rows = {row.name: row for row in earlier_rows(times, before, "abc")}
    assert rows["old block wbc"].value == 80.0
    assert rows["controller as of abc, its blocks only"].value == 120.0
    fused = rows[f"{FUSED}, beside abc"]
    assert fused.ratio == pytest.approx(0.05)  # 4 of 80, and 8 of 160
    assert fused.met is False and fused.floor is not None and fused.ratio > fused.goal
    assert earlier_rows(times, [], "")[0].value is None
