"""``aloft study paper``: pictures with something in them, numbers in a file, the page made of it."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from aloft.lab.cli import paper
from aloft.lab.figures.paper import page
from aloft.studies import offscreen
from aloft.studies.reading import read_study

CallJson = Callable[..., dict[str, Any]]

ROOT = Path(__file__).parents[3]


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), float)


def has_content(path: Path, size: list[int]) -> None:
    """Of that size, neither empty nor noise, with curves or bodies in colour on a light ground."""
    found = pixels(path)
    assert [found.shape[1], found.shape[0]] == size
    spread = found.max(axis=2) - found.min(axis=2)
    assert 0.002 < (spread > 60).mean() < 0.5
    assert found.mean() > 150


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The command on runs that end soon: long enough for the pushes' flight to begin."""
    from aloft.cli.shared.output import console

    folder = tmp_path_factory.mktemp("paper")
    study = folder / "short.yaml"
    text = paper.STUDY.read_text()
    text = text.replace("../", f"{paper.STUDY.parents[1]}/")
    text = re.sub(r"^seeds: .*$", "seeds: 3", text, flags=re.MULTILINE)
    study.write_text(text + "set: {duration: 40 ms}\n")
    screen = console(quiet=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(offscreen, "_context", unavailable)
        code = paper.draw_paper(folder / "out", "", 1, screen, False, study)
    assert code == 0
    return folder / "out", json.loads((folder / "out" / "paper.json").read_text())


def unavailable(width: int, height: int) -> Any:
    raise offscreen.NoRendererError(f"no OpenGL without a screen (none here); {offscreen.REMEDY}")


@pytest.mark.long
def test_curves_are_drawn_and_frames_left_out_where_nothing_renders(
    drawn: tuple[Path, dict[str, Any]],
) -> None:
    out, results = drawn
    for name in ("jump", "push"):
        figure = results["figures"][name]
        assert figure["drawn"]
        found = pixels(out / figure["file"])
        assert [found.shape[1], found.shape[0]] == figure["size"]
        assert found.mean() > 200 and found.std() > 10
    for name in ("step", "somersault", "somersault_in_place"):
        figure = results["figures"][name]
        assert not figure["drawn"] and "libegl1 libgl1-mesa-dri" in figure["reason"]
        assert not (out / figure["file"]).exists()


@pytest.mark.long
def test_the_page_says_what_came_of_the_runs(drawn: tuple[Path, dict[str, Any]]) -> None:
    out, results = drawn
    text = (out / "paper.md").read_text()
    assert text == page(results)
    assert results["seeds"] == [3] and results["figure_seed"] == 3
    # runs so short that nothing took off: no success is claimed, no picture is linked
    assert all(task["successes"] == 0 for task in results["tasks"].values())
    assert "0 of 1 seeds succeed" in text and "does not work reliably in closed loop yet" in text
    assert "*Not drawn: no OpenGL" in text and "(paper_step.png)" not in text


def test_what_the_command_does_not_take_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call_json: CallJson
) -> None:
    monkeypatch.chdir(tmp_path)
    result = call_json("study", "paper", "--dry-run", code=2)
    assert result["reason"] == "'aloft study paper' takes --out, --seeds, --workers and --json"


def test_the_page_in_the_documentation_is_made_of_its_numbers() -> None:
    results = json.loads((ROOT / "docs" / "paper.json").read_text())
    assert (ROOT / "docs" / "paper.md").read_text() == page(results)
    tasks = [task.name for task in read_study(paper.STUDY).tasks]
    assert list(results["tasks"]) == tasks and results["seeds"]
    for figure in results["figures"].values():
        if figure["drawn"]:
            has_content(ROOT / "docs" / figure["file"], figure["size"])


def test_a_changed_number_changes_the_page() -> None:
    results = json.loads((ROOT / "docs" / "paper.json").read_text())
    before = page(results)
    results["figures"]["jump"]["numbers"]["com_squat_to_apex_cm"] = 12.3
    results["tasks"]["step up"]["successes"] = 0
    after = page(results)
    assert "| 15 | 12.3 |" in after and "| 15 | 12.3 |" not in before
    assert re.search(r"succeed \| yes \| 0 of \d+ \|", after)


def test_the_page_claims_no_success_and_links_no_picture_that_is_not_there() -> None:
    results = json.loads((ROOT / "docs" / "paper.json").read_text())
    for task in results["tasks"].values():
        task["successes"] = 0
    results["figures"]["step"] |= {"drawn": False, "reason": "no OpenGL without a screen"}
    assert "does not work reliably in closed loop yet" in page(results)
    assert "*Not drawn: no OpenGL" in page(results) and "(paper_step.png)" not in page(results)
    told = json.loads((ROOT / "docs" / "paper.json").read_text())
    assert "does not work reliably in closed loop yet" not in page(told)
    assert "*Not drawn" not in page(told) and "(paper_step.png)" in page(told)
