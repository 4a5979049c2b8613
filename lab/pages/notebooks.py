"""Makes the notebooks of the gallery: ``python lab/pages/notebooks.py FOLDER``, or ``make notebooks``.

Each section of docs/gallery.md becomes a notebook beside copies of the files that it uses. Nothing is declared twice:
text, graph and commands are the page's. A run and a plot become Python; a command for a second machine stays text.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

DOCS = Path(__file__).parents[2] / "docs"
COPIED = ("gallery", "projects")


class Example(NamedTuple):
    """A section of the gallery: the file of its picture is its name; ``folder`` is where its commands run."""

    name: str
    folder: str
    title: str
    text: str
    language: str
    code: str
    commands: tuple[str, ...]


def examples(page: str) -> Iterator[Example]:
    """Yield the sections of the gallery's page, in its order."""
    for section in page.split("\n## ")[1:]:
        title, _, rest = section.partition("\n")
        text, marked, rest = rest.partition("<!-- from: ")
        source, _, rest = rest.partition(" -->")
        found = re.search(r"```(\w+)\n(.*?)```\n.*?```sh\n(.*?)```", rest, re.DOTALL)
        picture = re.search(r"!\[[^\]]*\]\(gallery/(\w+)\.", rest)
        if not (marked and found and picture):
            raise ValueError(f"the section {title!r} lacks its file, its commands or its picture")
        folder = Path(source).parent
        here = folder.relative_to("docs") if folder.is_relative_to("docs") else Path("gallery")
        commands = tuple(filter(None, found[3].splitlines()))
        yield Example(
            picture[1], here.as_posix(), title, text.strip(), found[1], found[2], commands
        )


def cell_of(command: str, recorded: bool = False) -> dict[str, Any]:
    """Return a cell that does the same as a command of the page; ``recorded``: later ones read the
    recording of a run."""
    words = shlex.split(command, comments=True)
    words = [w.replace("graphs/", "aloft:").removesuffix(".yaml") if w.startswith("graphs/") else w
             for w in words]  # fmt: skip
    if "--machine" in words:
        return markdown(f"On several machines, in a terminal of each:\n\n    {command}")
    match words:
        case ["aloft", "run", graph, *rest] if not recorded and set(rest[::2]) <= {"--set"}:
            settings = f", {rest[1::2]!r}" if rest else ""
            return code(f"result = aloft.load({graph!r}{settings}).run()\nresult")
        case ["aloft", "plot", _, *signals]:
            return code(f"result.plot({', '.join(map(repr, signals))})")
        case ["python", program]:
            return code(f"%run {program}")
        case ["aloft", "render", recording, *_]:
            film = f"{Path(recording).stem}.gif"
            return code(f"!{command}\nfrom IPython.display import Image\nImage({film!r})")
    return code(f"!{command}")


def markdown(text: str) -> dict[str, Any]:
    """Return a cell of text."""
    return {"cell_type": "markdown", "metadata": {}, "source": text}


def code(text: str) -> dict[str, Any]:
    """Return a cell that was not run yet."""
    return {
        "cell_type": "code", "metadata": {}, "source": text, "outputs": [], "execution_count": None,
    }  # fmt: skip


def notebook(example: Example) -> dict[str, Any]:
    """Return the notebook of an example, in nbformat 4.5."""
    text = re.sub(
        r"\[([^\]]+)\]\((?!http)[^)]+\)", r"*\1*", example.text
    )  # pages that are not here
    recorded = any(command.startswith("aloft render") for command in example.commands)
    cells = [
        markdown(f"# {example.title}\n\n{text}"),
        code("import aloft"),
        markdown(f"```{example.language}\n{example.code}```"),
        *(cell_of(command, recorded) for command in example.commands),
    ]
    return {
        "cells": [{"id": f"cell-{k}", **cell} for k, cell in enumerate(cells)],
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def write(folder: Path) -> list[Path]:
    """Write all notebooks, and what they use, into a folder; gives their paths."""
    for name in COPIED:
        shutil.copytree(
            DOCS / name, folder / name, dirs_exist_ok=True,
            ignore=shutil.ignore_patterns("__pycache__", "recordings", "test_*"),
        )  # fmt: skip
    paths = []
    for example in examples((DOCS / "gallery.md").read_text(encoding="utf-8")):
        path = folder / example.folder / f"{example.name}.ipynb"
        path.write_text(json.dumps(notebook(example), indent=1), encoding="utf-8")
        paths.append(path)
    return paths


if __name__ == "__main__":
    for made in write(Path(sys.argv[1] if len(sys.argv) > 1 else "site/notebooks")):
        print(made)
