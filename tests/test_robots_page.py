"""What docs/robots.md shows is what the commands print and write."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from aloft.robots.importing.package_files import find_file

PAGE = Path(__file__).parent.parent / "docs" / "robots.md"


def test_the_page_of_robots_is_up_to_date(docs_script: Callable[[str], ModuleType]) -> None:
    script = docs_script("refresh")
    if find_file(script.URDF, Path("/")) is None:
        pytest.skip("the package example-robot-data is not installed (pip install it)")
    page = PAGE.read_text(encoding="utf-8")
    blocks = script.printed_of_robots()
    assert all(text and text in page for text in blocks.values())
    assert script.with_printed(page, blocks) == page
