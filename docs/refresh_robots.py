"""Writes what ``aloft robot`` prints and writes for an example into docs/robots.md.

    python docs/refresh_robots.py

It needs the package example-robot-data.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from aloft.robots.importing.urdf_text import find_file

PAGE = Path(__file__).parent / "robots.md"
URDF = "package://example-robot-data/robots/go1_description/urdf/go1.urdf"


def printed() -> dict[str, str]:
    """The text of each block of the page by what it is called there."""
    source = find_file(URDF, Path("/"))
    if source is None:
        raise SystemExit("the package example-robot-data is not installed")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(source, folder / "go1.urdf")

        def aloft(*arguments: str) -> str:
            command = [sys.executable, "-m", "aloft", "robot", *arguments]
            run = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
            return "\n".join(line.rstrip() for line in run.stdout.splitlines()).strip("\n")

        shown = aloft("show", "go1.urdf")
        aloft("import", "go1.urdf")
        written = (folder / "go1.yaml").read_text(encoding="utf-8").strip("\n")
    return {"robot show go1.urdf": shown, "go1.yaml": written}


def filled(page: str, blocks: dict[str, str]) -> str:
    """The page with the blocks behind their marks."""
    for name, text in blocks.items():
        pattern = rf"(<!-- printed: {re.escape(name)} -->\n```\w*\n).*?(```\n)"
        page = re.sub(pattern, lambda m, t=text: f"{m[1]}{t}\n{m[2]}", page, flags=re.DOTALL)
    return page


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), printed()), encoding="utf-8")
