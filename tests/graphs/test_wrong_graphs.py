"""Every wrong graph gives exactly the report beside it.

After a change of the reports run this file as a script, and read the difference before you keep it.
"""

import json
import re
from pathlib import Path

import pytest

from aloft.files.problems import listing
from aloft.robots.description import robot_names
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.requirements import fix_without_robot
from aloft.runtime.loading import Code, LoadError, Report, check, checked_file

FOLDER = Path(__file__).parent / "wrong"
GRAPHS = sorted(path.stem for path in FOLDER.glob("*.yaml"))


def report_of(name: str) -> Report:
    """The report on a wrong graph, from within its folder, so that the places are short."""
    first = (FOLDER / f"{name}.yaml").read_text().partition("\n")[0]
    texts = first.removeprefix("# overrides: ").split(" | ") if "# overrides: " in first else []
    return check(f"{name}.yaml", texts)


def text_of(report: Report) -> str:
    """The report's text, without the folder of this checkout and the names of our robots."""
    text = re.sub(r"one of the \d+ that ship", "one of the N that ship", report.text())
    text = text.replace(f"{FOLDER.resolve()}/", "") + "\n"
    return text.replace(fix_without_robot(), "robot: ROBOT").replace(
        listing(robot_names()), "ROBOTS"
    )


def test_there_are_many() -> None:
    assert len(GRAPHS) >= 30


@pytest.mark.parametrize("name", GRAPHS)
def test_report(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    report = report_of(name)
    assert not report.ok
    assert text_of(report) == (FOLDER / f"{name}.txt").read_text()
    for problem in report.problems:
        place = problem.where
        if place.file.startswith("--set "):
            assert str(place) == place.file
            continue
        lines = Path(place.file).read_text().splitlines() or [""]
        assert 1 <= place.line <= len(lines)
        assert 1 <= place.column <= len(lines[place.line - 1]) + 1


def test_ten_mistakes_in_one_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    codes = [problem.code for problem in report_of("ten_mistakes").problems]
    assert len(dict.fromkeys(codes)) >= 10
    assert codes.count(Code.LOOP) == 1


def test_load_raises_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    with pytest.raises(LoadError) as caught:
        checked_file("shape.yaml")
    assert caught.value.report == check("shape.yaml")
    assert str(caught.value) == caught.value.report.text()
    assert caught.value.exit_code == ExitCode.BAD_INPUT


def test_every_kind_of_problem_is_shown_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    shown = {problem.code for name in GRAPHS for problem in report_of(name).problems}
    assert shown >= set(Code) - {Code.TOO_LARGE, Code.BLOCK_DECLARATION}


def test_json(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    data = json.loads(json.dumps(check("unit_scale.yaml").as_json()))
    assert data == {
        "file": "unit_scale.yaml",
        "ok": False,
        "count": 1,
        "problems": [
            {
                "code": "unit",
                "message": "relay.height does not fit source.millimetres: field 'height' has "
                "another scale",
                "file": "unit_scale.yaml",
                "line": 4,
                "column": 42,
                "at": "relay.height",
                "other": {
                    "path": "source.millimetres",
                    "file": "unit_scale.yaml",
                    "line": 3,
                    "column": 3,
                },
                "expected": "m",
                "found": "mm",
                "nearest": [],
                "fix": "multiply by 0.001 in a block between: 1 mm is 0.001 m; blocks.Gain with "
                "{gain: 0.001, unit: m/mm}",
            }
        ],
    }


def test_rich_text_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(FOLDER)
    report = report_of("ten_mistakes")
    plain = [line.rstrip() for line in report.text().splitlines()]
    assert [line.rstrip() for line in report.rich().plain.splitlines()] == plain


if __name__ == "__main__":
    import os

    os.chdir(FOLDER)
    for graph in GRAPHS:
        (FOLDER / f"{graph}.txt").write_text(text_of(report_of(graph)))
