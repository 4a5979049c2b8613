"""``aloft new``: writes the first files of a project, a block, a graph or a robot, with their tests."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from ..runtime.language.errors import AloftError
from .shared import templates
from .shared.output import errors_reported

new = typer.Typer(
    name="new",
    help="Write the first files of a project, a block, a graph or a robot, with a test each.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Folder = Annotated[Path, typer.Option("--in", help="The folder to write into.")]


def run_tests() -> str:
    """Return the command that runs tests; pytest comes with the development tools, not with aloft."""
    return "pytest" if find_spec("pytest") is not None else "pip install pytest; pytest"


@new.command("project")
def project(
    name: Annotated[str, typer.Argument(help="The folder's name, such as my_robot.")],
) -> None:
    """Make a folder with a graph, a block, their tests, a README and a schema for editors."""
    with errors_reported(False):
        folder = Path(name)
        title = folder.name.replace("_", " ").replace("-", " ")
        values = {"module": "smoother", "name": "Smoother", "title": title or "A project"}
        files = {
            "README.md": templates.README.format(**values),
            ".gitignore": templates.IGNORE,
            "graph.yaml": templates.PROJECT_GRAPH.format(**values),
            "graph.schema.json": _schema(),
            ".vscode/settings.json": templates.EDITOR,
            "test_graph.py": templates.TEST_GRAPH,
            **_block_files("Smoother"),
        }
        _write(folder, files)
    typer.echo(f"next: cd {folder}; aloft run graph.yaml; {run_tests()}")


@new.command("block")
def block(
    name: Annotated[str, typer.Argument(help="The class's name, such as LegSpring.")],
    folder: Folder = Path(),
) -> None:
    """Make a block that works, with its test."""
    with errors_reported(False):
        files = _block_files(name)
        _write(folder, files)
    module = next(iter(files)).removesuffix(".py")
    typer.echo(f"next: {run_tests()} test_{module}.py; a graph uses it as {module}:{name}")


@new.command("graph")
def graph(
    name: Annotated[str, typer.Argument(help="The file's name without its ending.")],
    folder: Folder = Path(),
) -> None:
    """Make a graph of library blocks that runs, and the schema with which editors complete it."""
    with errors_reported(False):
        file = f"{_module(name)}.yaml"
        files = {file: templates.GRAPH.format(file=file)}
        if not (folder / "graph.schema.json").exists():
            files["graph.schema.json"] = _schema()
        _write(folder, files)
    typer.echo(f"next: aloft run {folder / file}")


@new.command("robot")
def robot(
    name: Annotated[str, typer.Argument(help="The robot's name, such as pendulum.")],
    folder: Folder = Path(),
) -> None:
    """Make a robot with one motor as MJCF, a YAML of everything that MJCF lacks, a graph that holds
    it, and a test."""
    with errors_reported(False):
        module = _module(name)
        command = "value: {mode: 1, position: 0.5, stiffness: 30, damping: 1}"
        files = {
            f"{module}.xml": templates.ROBOT_MODEL.format(name=module),
            f"{module}.yaml": templates.ROBOT.format(name=module),
            f"{module}_hold.yaml": templates.ROBOT_GRAPH.format(name=module, command=command),
            f"test_{module}.py": templates.TEST_ROBOT.format(name=module),
        }
        _write(folder, files)
    typer.echo(
        f"next: aloft robot show {folder / module}.xml; aloft run {folder / module}_hold.yaml"
    )


def _block_files(name: str) -> dict[str, str]:
    """Return the files of a block called ``name``. Raises ``AloftError`` if no class can be called
    so."""
    from ..runtime.language.registry import snake_case

    if not name.isidentifier() or keyword.iskeyword(name) or not name[0].isupper():
        words = "".join(word[:1].upper() + word[1:] for word in re.split(r"\W+|_", name))
        hint = f"; for instance {words}" if words.isidentifier() else ""
        raise AloftError(f"a block cannot be called {name!r}, which is no name of a class{hint}")
    module = snake_case(name)
    title = snake_case(name).replace("_", " ").capitalize()
    return {
        f"{module}.py": templates.BLOCK.format(name=name, title=title),
        f"test_{module}.py": templates.TEST_BLOCK.format(name=name, module=module),
    }


def _module(name: str) -> str:
    """Return the name, if files and modules can have it. Raises ``AloftError`` otherwise."""
    if not name.isidentifier() or keyword.iskeyword(name):
        likely = re.sub(r"\W+", "_", name).strip("_").lower()
        hint = f"; for instance {likely}" if likely.isidentifier() else ""
        raise AloftError(f"{name!r} is no name of letters, digits and _{hint}")
    return name


def _schema() -> str:
    from ..runtime.loading.schema import schema_text

    return schema_text()


def _write(folder: Path, files: Mapping[str, str]) -> None:
    """Write all files, or none if one of them is there.

    Raises:
        AloftError: a file is there already, or cannot be written.
    """
    there = [str(folder / name) for name in files if (folder / name).exists()]
    if there:
        raise AloftError(f"{', '.join(there)} would be overwritten; nothing was written")
    try:
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
            typer.echo(f"wrote {folder / name}")
    except OSError as error:
        raise AloftError(f"cannot write: {error}") from error
