"""What is imported is asked for: by the package in its dependencies, by the tests in the dev group."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
NOT_SHIPPED = ("tests", "docs", "scripts", "lab")
BY = {
    "PIL": "pillow",
    "dask": "distributed",
    "lsprotocol": "pygls",
    "mujoco": "mujoco-core",
    "fmu_manipulation_toolbox": "fmu-manipulation-toolbox",
    "pinocchio": "pin",
    "pydantic_core": "pydantic",
    "pydrake": "drake",
    "rerun": "rerun-sdk",
    "serial": "pyserial",
    "tornado": "distributed",
    "yaml": "pyyaml",
    "zenoh": "eclipse-zenoh",
}
"""Who brings a module, where that is not a distribution of its name."""


def distributions(*lists: list[str]) -> set[str]:
    return {re.split(r"[^\w.-]", text)[0].lower() for found in lists for text in found}


EXTRAS = PROJECT["project"]["optional-dependencies"].values()
PACKAGE = distributions(PROJECT["project"]["dependencies"], *EXTRAS)
TESTS = PACKAGE | distributions(PROJECT["dependency-groups"]["dev"])


LINE = re.compile(r"^[ \t]*(?:import|from)[ \t]+(\w+)", re.MULTILINE)
"""What may be an import, one a line as the style wants it; in a docstring it may be none."""


@cache
def neighbours(folder: Path) -> frozenset[str]:
    return frozenset(other.stem for other in folder.glob("*.py"))


def others_modules(source: str) -> Iterator[str]:
    """The top-level modules that a source imports from elsewhere."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def python_files(folder: Path) -> list[Path]:
    hidden = {"__pycache__", *(() if folder.name in NOT_SHIPPED else ("tests", "conftest.py"))}
    return [p for p in sorted(folder.glob("**/*.py")) if hidden.isdisjoint(p.parts)]


def undeclared(folders: list[Path], declared: set[str]) -> Iterator[str]:
    for path in (path for folder in folders for path in python_files(folder)):
        ours = {
            *sys.stdlib_module_names,
            "aloft",
            "tests",
            "extensions",
            "lab",
            *neighbours(path.parent),
        }

        def is_undeclared(name: str, ours: set[str] = ours) -> bool:
            return name not in ours and BY.get(name, name).lower() not in declared

        source = path.read_text(encoding="utf-8")
        if any(map(is_undeclared, LINE.findall(source))):  # only then is it worth to parse the file
            for name in dict.fromkeys(filter(is_undeclared, others_modules(source))):
                yield f"{path.relative_to(ROOT)} imports {name}"


def test_the_package_asks_for_what_it_imports() -> None:
    listed = PROJECT["tool"]["setuptools"]["packages"]
    folders = {name.split(".")[1] for name in listed if "." in name}
    assert {"blocks", "runtime", "cli"} <= folders
    assert not list(undeclared([ROOT / folder for folder in sorted(folders)], PACKAGE))


def test_the_tests_ask_for_what_they_import() -> None:
    assert not list(
        undeclared(
            [*(ROOT / folder for folder in NOT_SHIPPED), *ROOT.glob("extensions/*/tests")], TESTS
        )
    )
    assert any(undeclared([ROOT / "tests"], PACKAGE)), "pytest is not the package's"
