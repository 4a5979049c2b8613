"""The script that writes what is generated in the pages."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("refresh")


def test_every_command_of_a_page_is_one_of_the_scripts(script: ModuleType) -> None:
    used = []
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]:
        used += re.findall(r"docs/refresh\.py (\w+)", page.read_text(encoding="utf-8"))
    assert len(used) >= 4 and set(used) <= set(script.PAGES)


def test_help_names_every_page(script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main(["--help"]) == 0
    said = capsys.readouterr().out
    for name, page in script.PAGES.items():
        assert f"{name}: " in said and page.write.__doc__ in said


@pytest.mark.parametrize("arguments", [["unknown"], ["tick"], ["excerpts", "a.json"]])
def test_a_wrong_command_says_how(
    script: ModuleType, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    assert script.main(arguments) == 2
    assert "python docs/refresh.py tick FILE" in capsys.readouterr().err


def test_a_page_without_the_marks_is_refused(script: ModuleType, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- x -->\nold\n<!-- end of x -->\nafter\n")
    script.refresh(page, "x", "new\n")
    assert page.read_text() == "before\n<!-- x -->\nnew\n<!-- end of x -->\nafter\n"
    with pytest.raises(ValueError, match=r"page\.md has no <!-- y --> with an <!-- end of y -->"):
        script.refresh(page, "y", "new\n")
