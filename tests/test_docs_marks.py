"""Parts of pages between marks are written anew; every script of docs/ finds its place on its page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parent.parent
PLACES = {
    "README.md": ("results", "tasks", "tick"),
    "docs/bring_up.md": ("twin",),
    "docs/compiled.md": ("tick",),
    "docs/frontier.md": ("frontier",),
    "docs/landing.md": tuple(
        f"{table}{rise}"
        for table in ("impulses", "quarters", "directions")
        for rise in ("", " 12 cm")
    ),
    "docs/planning.md": ("task parameters",),
    "docs/results.md": ("results", "tasks"),
    "docs/robots_results.md": ("tasks",),
}


@pytest.fixture(scope="module")
def marks(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("marks")


def test_only_what_is_between_the_marks_changes(marks: ModuleType, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- x -->\nold\n<!-- end of x -->\nb \\1\n")
    marks.refresh(page, "x", "new \\1\n")
    assert page.read_text() == "a\n<!-- x -->\nnew \\1\n<!-- end of x -->\nb \\1\n"


def test_the_second_mark_may_have_another_name(marks: ModuleType, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- study: x -->\n<!-- end of x -->")
    marks.refresh(page, "study: x", "new\n", of="x")
    assert page.read_text() == "<!-- study: x -->\nnew\n<!-- end of x -->"


@pytest.mark.parametrize("text", ["", "<!-- x -->\n", "<!-- end of x --><!-- x -->\n"])
def test_a_page_without_both_marks_stays_as_it_is(
    marks: ModuleType, tmp_path: Path, text: str
) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(ValueError, match=r"page.md has no <!-- x --> with an <!-- end of x --> "):
        marks.refresh(page, "x", "new")
    assert page.read_text() == text


@pytest.mark.parametrize(("page", "mark"), [(p, m) for p, every in PLACES.items() for m in every])
def test_every_page_has_its_places(marks: ModuleType, tmp_path: Path, page: str, mark: str) -> None:
    copy = tmp_path / "page.md"
    copy.write_text((ROOT / page).read_text(encoding="utf-8"), encoding="utf-8")
    marks.refresh(copy, mark, "| new |\n")
    assert f"<!-- {mark} -->\n| new |\n<!-- end of {mark} -->" in copy.read_text("utf-8")
