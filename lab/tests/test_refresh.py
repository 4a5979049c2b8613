"""The script that writes what is generated in the pages."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
PLACES = {
    "extensions/commissioning/bring_up.md": ("twin",),
    "extensions/export/c_library.md": ("export",),
    "docs/compiled.md": ("tick",),
    "docs/frontier.md": ("frontier",),
    "docs/landing.md": ("quarters", "quarters 12 cm"),
    "docs/planning.md": ("task parameters",),
    "docs/results.md": ("results", "tasks"),
    "docs/robots_results.md": ("tasks",),
}


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("refresh")


def test_every_command_of_a_page_is_one_of_the_scripts(script: ModuleType) -> None:
    used = []
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]:
        used += re.findall(r"pages/refresh\.py (\w+)", page.read_text(encoding="utf-8"))
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
    assert "python lab/pages/refresh.py tick FILE" in capsys.readouterr().err


def test_only_what_is_between_the_marks_changes(script: ModuleType, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- x -->\nold\n<!-- end of x -->\nb \\1\n")
    script.refresh(page, "x", "new \\1\n")
    assert page.read_text() == "a\n<!-- x -->\nnew \\1\n<!-- end of x -->\nb \\1\n"


def test_the_second_mark_may_have_another_name(script: ModuleType, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- study: x -->\n<!-- end of x -->")
    script.refresh(page, "study: x", "new\n", of="x")
    assert page.read_text() == "<!-- study: x -->\nnew\n<!-- end of x -->"


@pytest.mark.parametrize("text", ["", "<!-- x -->\n", "<!-- end of x --><!-- x -->\n"])
def test_a_page_without_both_marks_stays_as_it_is(
    script: ModuleType, tmp_path: Path, text: str
) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(ValueError, match=r"page.md has no <!-- x --> with an <!-- end of x --> "):
        script.refresh(page, "x", "new")
    assert page.read_text() == text


@pytest.mark.parametrize(("page", "mark"), [(p, m) for p, every in PLACES.items() for m in every])
def test_every_page_has_its_places(
    script: ModuleType, tmp_path: Path, page: str, mark: str
) -> None:
    copy = tmp_path / "page.md"
    copy.write_text((ROOT / page).read_text(encoding="utf-8"), encoding="utf-8")
    script.refresh(copy, mark, "| new |\n")
    assert f"<!-- {mark} -->\n| new |\n<!-- end of {mark} -->" in copy.read_text("utf-8")
