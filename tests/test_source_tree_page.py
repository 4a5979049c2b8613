"""docs/source_tree.md names files and folders that are there, and every folder of the package."""

import re
import tomllib
from pathlib import Path

import pytest

import aloft

ROOT = Path(aloft.__file__).parent
TEXT = (ROOT / "docs" / "source_tree.md").read_text()
PATH = re.compile(r"`([\w./]+/[\w./]*)`")
STORY = re.compile(r"^## (How .*?)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
STORIES = dict(STORY.findall(TEXT))
MOST_FILES = 10


def folder_rows() -> list[tuple[str, str, str]]:
    """Folders, text and entry point of each row of the table."""
    rows = [line.strip("| ").split(" | ") for line in TEXT.splitlines() if line.startswith("| `")]
    return [(folder, text, entry) for folder, text, entry in rows]


def test_all_files_and_folders_are_there() -> None:
    inside = {f"{path.name}/" for path in ROOT.rglob("*") if path.is_dir()}
    named = PATH.findall(TEXT)
    assert len(named) > 100
    assert not [path for path in named if not (ROOT / path).exists() and path not in inside]


def test_every_folder_has_a_file_to_begin_with() -> None:
    for folder, text, entry in folder_rows():
        assert text
        assert (ROOT / entry.strip("`")).is_file(), folder


def test_every_package_is_in_a_row() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    packages = project["tool"]["setuptools"]["packages"]
    rows = {}
    for folder, text, _ in folder_rows():
        for name in PATH.findall(folder):
            rows[name.rstrip("/")] = text
    for package in packages:
        parts = package.split(".")[1:]
        if parts[:1] == ["extensions"]:
            parts = parts[:2]  # a row an extension, whose folders have the names of the core's
        path, parent, last = "/".join(parts), "/".join(parts[:-1]), parts[-1] if parts else ""
        holds = any(name.startswith(f"{path}/") for name in rows)
        assert not parts or path in rows or f"`{last}/`" in rows.get(parent, "") or holds, package


@pytest.mark.parametrize("title", STORIES)
def test_a_story_names_few_files(title: str) -> None:
    assert 5 <= len(set(PATH.findall(STORIES[title]))) <= MOST_FILES


def test_there_are_three_stories_and_ten_walks() -> None:
    assert len(STORIES) == 3
    assert len(re.findall(r"^\*\*\.\.\. ", TEXT, re.MULTILINE)) == 10
