"""What the scripts that refresh the pages have in common: a part of a page between two marks."""

from __future__ import annotations

from pathlib import Path


def refresh(page: Path, mark: str, text: str, of: str = "") -> None:
    """Write ``text`` between ``<!-- mark -->`` and ``<!-- end of mark -->`` of a page.

    Args:
        of: what the second mark is the end of, where that is not ``mark`` itself.

    Raises:
        ValueError: the page does not have both marks.
    """
    begin, end = f"<!-- {mark} -->\n", f"<!-- end of {of or mark} -->"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{page.name} has no {begin.strip()} with an {end} behind it")
    page.write_text(before + begin + text + end + after, encoding="utf-8")
