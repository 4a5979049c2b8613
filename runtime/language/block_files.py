"""Finds blocks in Python files by parsing them, without importing any."""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

_PORTS = ("Input", "Output")
_MACHINE = ("step", "emit")
_PACKAGE = Path(__file__).parents[2]
_CLASS = re.compile(rb"^class (\w+)", re.MULTILINE)
_MOST_FILES = 300
"""Largest number of files of a user's folder that are read in order to propose names."""


@dataclass(frozen=True)
class WrittenClass:
    """A class as it stands in the source."""

    name: str
    bases: tuple[str, ...]
    """The base classes, each by the last part of its name: ``Block`` for ``aloft.Block``."""
    has_ports: bool
    """True if it declares a port, or defines ``specialize``, which may give it some."""
    has_machine: bool
    """True if it defines ``step`` or ``emit``."""
    is_abstract: bool
    """True if it is declared abstract: by ``ABC`` among its bases, or by an abstract method."""


def classes_in(path: Path) -> tuple[WrittenClass, ...]:
    """Return the classes at the top level of a file; none if it cannot be read or parsed."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
        if "class " not in text:
            return ()
        tree = ast.parse(text)
    except (OSError, SyntaxError, ValueError, RecursionError):
        return ()
    return tuple(_written(node) for node in tree.body if isinstance(node, ast.ClassDef))


def blocks_in_packages(packages: Mapping[str, Path]) -> Mapping[str, Path]:
    """Find the blocks that graphs can use as ``package.Class``, with their files, sorted by name.

    A class is a block if it derives from ``Block`` or ``KernelBlock``, also through other classes.
    It can be used if it has or inherits a port and one of the methods ``step`` and ``emit``, it is
    not written as an abstract class, and its name does not begin with an underscore.
    """
    classes = [
        (package, path, written)
        for package, folder in packages.items()
        for path in files_of(folder)
        for written in classes_in(path)
    ]
    found: dict[str, Path] = {}
    # with ports, with a machine
    known: dict[str, tuple[bool, bool]] = {"Block": (False, False), "KernelBlock": (False, True)}
    while True:
        new = [
            each
            for each in classes
            if each[2].name not in known and any(base in known for base in each[2].bases)
        ]
        if not new:
            return dict(sorted(found.items()))
        for package, path, written in new:
            inherited = [known[base] for base in written.bases if base in known]
            ports = written.has_ports or any(base[0] for base in inherited)
            machine = written.has_machine or any(base[1] for base in inherited)
            known[written.name] = (ports, machine)
            usable = ports and machine and not written.is_abstract
            if usable and not written.name.startswith("_"):
                found.setdefault(f"{package}.{written.name}", path)


def blocks_in_folder(folder: Path) -> Iterator[str]:
    """Blocks in a user's folder and the packages in it, as ``package.module:Class``.

    Only classes whose base has the name of a block are found, which is enough to propose a name.
    """
    for path in _some_files(folder):
        parts = path.relative_to(folder).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        for written in classes_in(path):
            if module and any(base.endswith("Block") for base in written.bases):
                yield f"{module}:{written.name}"


@lru_cache(maxsize=16)
def files_of(folder: Path) -> tuple[Path, ...]:
    """All Python files below a folder but those of its tests, sorted; it must not change while the program runs."""
    tests = str(folder / "tests")
    found: list[Path] = []
    for place, folders, files in os.walk(folder):  # which takes a quarter of the time of rglob
        if place == tests:
            folders.clear()
        else:
            found += [Path(place, file) for file in files if file.endswith(".py")]
    return tuple(sorted(found))


@lru_cache(maxsize=16)
def class_files(folder: Path) -> Mapping[str, Path]:
    """For the name of each class, the first of those files with a line that begins it: a look at their
    text, which takes a thirtieth of the time of parsing them."""
    found: dict[str, Path] = {}
    for path in files_of(folder):
        for name in _CLASS.findall(path.read_bytes()):
            found.setdefault(name.decode(errors="replace"), path)
    return found


def _some_files(folder: Path) -> Iterator[Path]:
    """Yield the Python files in a folder and in the folders that lie in it, up to
    ``_MOST_FILES``."""
    count = 0
    for pattern in ("*.py", "*/*.py"):
        for path in sorted(folder.glob(pattern)):
            if any(part.startswith(".") for part in path.relative_to(folder).parts):
                continue  # such as virtual environments and caches
            count += 1
            if count > _MOST_FILES:
                return
            yield path


def _written(node: ast.ClassDef) -> WrittenClass:
    functions = [item for item in node.body if isinstance(item, ast.FunctionDef)]
    values = [item.value for item in node.body if isinstance(item, (ast.Assign, ast.AnnAssign))]
    bases = tuple(filter(None, map(_last_name, node.bases)))
    return WrittenClass(
        node.name,
        bases,
        any(isinstance(value, ast.Call) and _last_name(value.func) in _PORTS for value in values)
        or any(function.name == "specialize" for function in functions),
        any(function.name in _MACHINE for function in functions),
        "ABC" in bases
        or any(
            _last_name(decorator) == "abstractmethod"
            for function in functions
            for decorator in function.decorator_list
        ),
    )


def _last_name(node: ast.expr) -> str:
    """``Block`` for ``aloft.Block``, ``Robot`` for ``Robot[Arm]``."""
    if isinstance(node, ast.Subscript):
        return _last_name(node.value)
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def imported_files(file: Path, root: Path) -> Iterator[Path]:
    """Yield the files below ``root`` that a module imports, with the packages they are in."""
    try:
        tree = ast.parse(file.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError, RecursionError):
        return
    for node in ast.walk(tree):
        names: list[str] = []
        base = root
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = file.parents[node.level - 1] if node.level else root
            module = node.module or ""
            names = [module, *(f"{module}.{alias.name}".strip(".") for alias in node.names)]
        for name in filter(None, names):
            parts = name.split(".")
            places = [base.joinpath(*parts[:k], "__init__.py") for k in range(1, len(parts) + 1)]
            for place in (*places, base.joinpath(*parts).with_suffix(".py")):
                if place.is_file() and place.is_relative_to(root) and _PACKAGE not in place.parents:
                    yield place
