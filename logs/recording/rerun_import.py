"""Imports Rerun's modules when they are first used: ``import rerun`` loads 500, of which a recorder needs 100.

Most of them define one class each, which an ``__init__`` takes out of them. Here such an import waits until
somebody asks the package for that name; all else that a package does is as it was.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType
from typing import Any

PACKAGE = "rerun"


def import_rerun() -> ModuleType:
    """Import Rerun in this way, from now on in this process; as a whole, if it cannot be so.

    Raises:
        ImportError: it is not installed.
    """
    finder = _PackageFinder()
    sys.meta_path.insert(0, finder)
    try:
        return import_module(PACKAGE)
    except Exception:  # noqa: BLE001  # a version that is made in another way
        sys.meta_path.remove(finder)
        for name in [name for name in sys.modules if name.partition(".")[0] == PACKAGE]:
            del sys.modules[name]
        return import_module(PACKAGE)


class _PackageFinder(MetaPathFinder):
    """Finds Rerun's packages; its modules, and whatever is no plain source, are for other finders."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a package's specification, with a loader that lets imports wait."""
        spec = PathFinder.find_spec(name, path) if name.partition(".")[0] == PACKAGE else None
        if spec is None or spec.submodule_search_locations is None or spec.origin is None:
            return None
        if type(spec.loader) is not SourceFileLoader:
            return None
        spec.loader = _PackageLoader(name, spec.origin)
        return spec


class _PackageLoader(SourceFileLoader):
    """Runs an ``__init__`` without those relative imports whose names nothing else in it uses."""

    def get_code(self, fullname: str) -> CodeType:
        """Compile what is run; what waits is in ``_waiting``: by its name here its module and its name there."""
        tree = ast.parse(self.get_data(self.path))
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} | {"*"}
        self._waiting: dict[str, tuple[str, str]] = {}
        for statement in [each for each in tree.body if isinstance(each, ast.ImportFrom)]:
            if statement.level:
                module = "." * statement.level + (statement.module or "")
                names = {each.asname or each.name: each for each in statement.names}
                self._waiting |= {n: (module, names[n].name) for n in names if n not in used}
                statement.names = [names[name] for name in names if name in used]
                if not statement.names:
                    tree.body.remove(statement)
        return compile(tree, self.path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        """Run the package, and let it look its names up."""
        theirs: Any = None

        def look_up(name: str) -> Any:
            if name in self._waiting:
                found = _imported(module.__name__, *self._waiting[name])
                setattr(module, name, found)
                return found
            if theirs is not None:
                return theirs(name)
            raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")

        names = vars(module)
        names["__getattr__"] = look_up
        super().exec_module(module)
        if names["__getattr__"] is not look_up:
            theirs, names["__getattr__"] = names["__getattr__"], look_up


def _imported(package: str, module: str, name: str) -> Any:
    """Do what ``from module import name`` does in a package."""
    found = import_module(module, package)
    if found.__name__ != package and hasattr(found, name):
        return getattr(found, name)
    return import_module(f"{found.__name__}.{name}")
