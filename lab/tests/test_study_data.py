"""The data files of studies: pages' tables are made of them, and what has changed since is named."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pyarrow as pa
import pytest
from pyarrow import parquet

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "docs" / "data").glob("*.json"))


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("study_data")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_number_of_a_table_is_its_data_files(script: ModuleType, file: Path) -> None:
    data = json.loads(file.read_text())
    assert len(data["commit"]) == 40 and set(data["commit"]) <= set("0123456789abcdef")
    assert (ROOT / data["study"]).is_file()
    for page in data["pages"]:
        text = (ROOT / page).read_text()
        assert text.count(f"<!-- data: {file.stem} -->") == 1
        inside = script.between(text, file.stem)
        table, _, rest = inside.partition("\n*Stale: ")
        assert table == script.inside_of(data), "run: python lab/pages/study_data.py mark"
        assert not rest or f"since commit {script.since(data)[:8]}" in rest


def results(folder: Path, runs: list[dict[str, Any]]) -> Path:
    folder.mkdir()
    parquet.write_table(pa.Table.from_pylist(runs), folder / "runs.parquet")
    cells = [{"task": task, "arm": "one"} for task in sorted({run["task"] for run in runs})]
    summary = {"study": "paper_pushes", "seeds": [5, 6, 7], "rows": cells}
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def run(task: str, success: bool, tilt: float | None, reason: str) -> dict[str, Any]:
    return {
        "task": task, "arm": "one", "success": success, "final_tilt_deg": tilt, "reason": reason,
        "seed": 5, "run_hash": f"hash of {task}",
    }  # fmt: skip


def test_runs_that_stand_are_counted_beside_those_that_succeed(
    script: ModuleType, tmp_path: Path
) -> None:
    folder = results(tmp_path / "found", [
        run("+x", True, 0.4, "all criteria hold"),
        run("+x", False, 0.9, "flight of 0.158 s is below 90% of the planned 0.200 s"),
        run("+x", False, None, "fell at 1.998 s: tilt 69.7 deg"),
        run("+y", False, 6.0, "turned 20.8 deg, not within 5.0 deg of 30.0 deg"),
    ])  # fmt: skip
    assert script.labels_of(folder) == ["task"]
    ahead, aside = script.rows_of(folder, ["task"])
    assert (ahead["n"], ahead["successes"], ahead["stands"]) == (3, 1, 2)
    assert ahead["misses"] == {"flight too short": 1, "fell": 1}
    assert (aside["stands"], aside["misses"]) == (0, {"turn": 1})
    data = {"labels": ["task"], "rows": [ahead, aside], "seeds": [5, 6, 7], "commit": "0123456789"}
    assert script.table_of(data).splitlines() == [
        "| task | stands | succeeds | misses |",
        "|---|---|---|---|",
        "| +x | 2 of 3 | 1 of 3 | 1 fell, 1 flight too short |",
        "| +y | 0 of 1 | 0 of 1 | 1 turn |",
        "",
        "Seeds 5 to 7 (a row has as many as it has runs, from the first), code of commit 01234567.",
    ]


@pytest.mark.parametrize(
    ("reason", "kind"),
    [
        (
            "something other than the contact points touched, first at 1.4 s, in 77 physics steps",
            "touched",
        ),
        ("stepped: a foot was off the ground for 0.028 s after landing", "stepped"),
        (
            "safety: foot switch right_toe is stuck: it was open under a foot that stood",
            "safety stop",
        ),
        ("no such reason", "other"),
    ],
)
def test_why_a_run_is_no_success_in_a_word(script: ModuleType, reason: str, kind: str) -> None:
    assert script.kind_of_miss(reason) == kind


def test_medians_are_of_runs_that_stand(script: ModuleType, tmp_path: Path) -> None:
    turns = [(20.0, 0.4), (21.0, 0.4), (25.0, 0.3), (170.0, 30.0)]
    runs = [{**run("turn", False, tilt, "turned"), "jump_yaw_deg": yaw} for yaw, tilt in turns]
    folder = results(
        tmp_path / "found", [*runs, {**run("up", False, None, "fell"), "jump_yaw_deg": 1.0}]
    )
    rows = script.rows_of(folder, ["task"], {"turned [deg]": ("jump_yaw_deg", 1.0)})
    assert [row["turned [deg]"] for row in rows] == [21.0, None]
    data = {
        "labels": ["task"],
        "medians": ["turned [deg]"],
        "rows": rows,
        "seeds": [5],
        "commit": "0",
    }
    head, _, first, second, *_ = script.table_of(data).splitlines()
    assert head == "| task | turned [deg] | stands | succeeds | misses |"
    assert first == "| turn | 21 | 3 of 4 | 0 of 4 | 4 turn |"
    assert second == "| up | - | 0 of 1 | 0 of 1 | 1 fell |"


def test_cells_with_more_seeds_take_the_place_of_those_with_fewer(
    script: ModuleType, tmp_path: Path
) -> None:
    fall = run("+x", False, None, "fell at 1.998 s")
    few = results(tmp_path / "few", [fall, run("+y", True, 0.1, "")])
    more = results(tmp_path / "more", [run("+x", True, 0.1, "")] * 3)
    (tmp_path / "docs" / "data").mkdir(parents=True)
    data = json.loads(script.keep(tmp_path, [few, more], "0" * 40).read_text())
    assert [(row["task"], row["n"], row["stands"]) for row in data["rows"]] == [
        ("+x", 3, 3),
        ("+y", 1, 1),
    ]
    (other := results(tmp_path / "other", [fall])).joinpath("summary.json").write_text(
        json.dumps({"study": "paper_plans", "seeds": [5], "rows": [{"task": "+x"}]})
    )
    with pytest.raises(ValueError, match="these are of paper_pushes and of paper_plans"):
        script.keep(tmp_path, [few, other], "0" * 40)


def test_runs_that_are_made_again_the_same_are_not_stale(
    script: ModuleType, tmp_path: Path
) -> None:
    (tmp_path / "docs" / "data").mkdir(parents=True)
    folder = results(tmp_path / "found", [run(task, True, 0.1, "") for task in ("+x", "+x", "+y")])
    file = script.keep(tmp_path, [folder], "0" * 40)
    probes = json.loads(file.read_text())["probes"]
    assert [each["run_hash"] for each in probes] == ["hash of +x", "hash of +y"]
    asked = list[tuple[str, str]]()

    def hashes(study: Path, probe: dict[str, Any]) -> list[str]:
        asked.append((study.name, probe["where"]["task"]))
        return ["hash of another direction", f"hash of {probe['where']['task']}"]

    differ = script.probe(tmp_path, ["paper_pushes"], "1" * 40, lambda *_: ["hash of +x"])
    assert differ == ["paper_pushes: {'task': '+y'}, seed 5, runs otherwise"]
    assert "same_at" not in json.loads(file.read_text())
    assert script.probe(tmp_path, ["paper_pushes"], "1" * 40, hashes) == []
    assert asked == [("paper_pushes.yaml", "+x"), ("paper_pushes.yaml", "+y")]
    data = json.loads(file.read_text())
    assert script.since(data) == data["same_at"] == "1" * 40
    script.keep(tmp_path, [folder], "0" * 40)
    assert json.loads(file.read_text()) == data, "more seeds of the same code need no new probes"
    assert script.made_line(data).endswith(
        "With the code of commit 11111111 the 2 of them that were run again are the same to the last bit."
    )


def git(root: Path, *arguments: str) -> str:
    who = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    done = subprocess.run(
        ["git", *who, *arguments], cwd=root, check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


def test_a_table_is_stale_when_what_it_measures_has_changed(
    script: ModuleType, tmp_path: Path
) -> None:
    for name in ("blocks/law.py", "blocks/tests/test_law.py", "docs/data/x.json", "docs/page.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("one\n")
    (tmp_path / "docs" / "page.md").write_text("<!-- data: x -->\n<!-- end of data: x -->\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "blocks")
    git(tmp_path, "commit", "-qm", "one")
    commit = git(tmp_path, "rev-parse", "HEAD")
    rows = [{"task": "up", "n": 2, "successes": 1, "stands": 2, "misses": {}}]
    data = {
        "commit": commit, "measures": ["blocks"], "pages": ["docs/page.md"], "labels": ["task"],
        "rows": rows, "seeds": [1, 2],
    }  # fmt: skip
    (tmp_path / "docs" / "data" / "x.json").write_text(json.dumps(data))
    script.write_tables(tmp_path)
    page = (tmp_path / "docs" / "page.md").read_text()
    assert "| up | 2 of 2 | 1 of 2 | - |" in page and "Stale" not in page
    (tmp_path / "blocks" / "tests" / "test_law.py").write_text("two\n")
    assert script.stale(tmp_path) == {}, "tests measure nothing"
    (tmp_path / "blocks" / "law.py").write_text("two\n")
    assert script.stale(tmp_path) == {"x": ["blocks/law.py"]}
    script.write_tables(tmp_path)
    page = (tmp_path / "docs" / "page.md").read_text()
    line = (
        f"*Stale: since commit {commit[:8]}, whose code made these runs, `blocks/law.py` changed.*"
    )
    assert line in page
    git(tmp_path, "commit", "-qam", "two")
    assert script.stale(tmp_path) == {"x": ["blocks/law.py"]}, "also when that is committed"


def test_a_page_without_the_marks_is_named(script: ModuleType) -> None:
    with pytest.raises(ValueError, match="there is no <!-- data: x --> with an <!-- end of data"):
        script.replaced("no marks", "x", "")
