"""What is imported is asked for: by the package in its dependencies, by the tests in the dev group."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
NOT_SHIPPED = ("tests", "docs", "scripts")
BY = {
    "PIL": "pillow",
    "dask": "distributed",
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


@cache
def others_modules(path: Path) -> tuple[str, ...]:
    """The top-level modules that a file imports and that are neither Python's nor the project's."""
    near = {other.stem for other in path.parent.glob("*.py")}
    known = {*sys.stdlib_module_names, "aloft", "tests", *near}
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [node.module]
        tops = dict.fromkeys(name.partition(".")[0] for name in names)
        found += [name for name in tops if name not in known]
    return tuple(found)


def python_files(folder: Path) -> list[Path]:
    return [p for p in sorted(folder.glob("**/*.py")) if "__pycache__" not in p.parts]


def undeclared(folders: list[Path], declared: set[str]) -> list[str]:
    return [
        f"{path.relative_to(ROOT)} imports {name}"
        for folder in folders
        for path in python_files(folder)
        for name in others_modules(path)
        if BY.get(name, name).lower() not in declared
    ]


def test_the_package_asks_for_what_it_imports() -> None:
    listed = PROJECT["tool"]["setuptools"]["packages"]
    folders = {name.split(".")[1] for name in listed if "." in name}
    assert {"blocks", "runtime", "cli"} <= folders
    assert not undeclared([ROOT / folder for folder in sorted(folders)], PACKAGE)


def test_the_tests_ask_for_what_they_import() -> None:
    assert not undeclared([ROOT / folder for folder in NOT_SHIPPED], TESTS)
    assert undeclared([ROOT / "tests"], PACKAGE), "pytest is not the package's"
