"""What docs/robots.md shows is what the commands print and write."""

import importlib.util
from pathlib import Path

import pytest

from aloft.robots.importing.packages import find_file

PAGE = Path(__file__).parent.parent / "docs" / "robots.md"
SCRIPT = PAGE.parent / "refresh_robots.py"


def test_the_page_of_robots_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("refresh_robots", SCRIPT)
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    if find_file(script.URDF, Path("/")) is None:
        pytest.skip("the package example-robot-data is not installed (pip install it)")
    page = PAGE.read_text(encoding="utf-8")
    blocks = script.printed()
    assert all(text and text in page for text in blocks.values())
    assert script.filled(page, blocks) == page
