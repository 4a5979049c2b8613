"""Imports modules that hold blocks: installed modules, and a user's files beside a graph."""

from __future__ import annotations

import importlib
import importlib.machinery
import importlib.util
import linecache
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import ModuleType

from .errors import AloftError, UnknownBlockError


class BlockImportError(AloftError):
    """A block's module or class cannot be used; the message is one line, ``where`` its origin."""

    def __init__(self, message: str, where: str = "") -> None:
        super().__init__(message)
        self.where = where


class UnknownModuleError(UnknownBlockError):
    """There is no such module."""


class NotImportedError(UnknownBlockError):
    """A user's module was needed where none is imported; see ``without_imports``."""


NOT_IMPORTED = "is not imported to look at a file"
"""The words by which this error is known where only its text is left."""
_ALLOWED: ContextVar[bool] = ContextVar("imports of users' modules", default=True)


@contextmanager
def without_imports() -> Iterator[None]:
    """Import no module that a file names, as long as this lasts: looking at a file never runs its code."""
    token = _ALLOWED.set(False)
    try:
        yield
    finally:
        _ALLOWED.reset(token)


def user_module(module_name: str, folders: Iterable[Path]) -> ModuleType:
    """Import a module from the first of some folders that has it, or else as an installed module.

    Raises:
        NotImportedError: no module of a user is imported now.
        UnknownBlockError: there is no such module, or the name cannot be one.
        BlockImportError: it fails when it is imported.
    """
    if not module_name or not all(part.isidentifier() for part in module_name.split(".")):
        raise UnknownBlockError(f"{module_name!r} is not the name of a module")
    if not _ALLOWED.get():
        raise NotImportedError(f"the module {module_name!r} {NOT_IMPORTED}")
    for folder in dict.fromkeys(folder.resolve() for folder in folders):
        file = _file_of(module_name, folder)
        if file is not None:
            before = _stamp(file)
            module = _fresh(_from_file(module_name, file, folder), file)
            _STAMPS.setdefault(module.__name__, before)
            return module
    return import_module(module_name)


_STAMPS: dict[str, tuple[int, int]] = {}
"""The time of change and the size of a user's file when its module was imported."""


def _stamp(file: Path) -> tuple[int, int]:
    status = file.stat()
    return status.st_mtime_ns, status.st_size


def _fresh(module: ModuleType, file: Path) -> ModuleType:
    """Return the module, executed anew if its file has changed since; modules that it imports stay
    as they are.

    Raises:
        BlockImportError: it fails.
    """
    stamp = _stamp(file)
    if _STAMPS.get(module.__name__, stamp) == stamp or module.__name__ == "__main__":
        return module
    linecache.checkcache(str(file))  # for the lines in tracebacks
    try:
        # Not importlib.reload: it takes the old code from the cache if the file was changed twice
        # within a second and is as long as before.
        exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)  # noqa: S102
    except (Exception, SystemExit) as error:
        raise _import_error(module.__name__, error) from error
    _STAMPS[module.__name__] = stamp
    return module


def import_module(module_name: str) -> ModuleType:
    """Import an installed module.

    Raises:
        UnknownModuleError: there is none of that name.
        BlockImportError: it fails when it is imported.
    """
    try:
        return importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # whatever a user's module may raise
        raise _import_error(module_name, error) from error


def find_source(module_name: str, folders: Iterable[Path]) -> Path | None:
    """Find the file that ``user_module`` would import, and import nothing; ``None``: there is none."""
    if not all(part.isidentifier() for part in module_name.split(".")):
        return None
    own = (_file_of(module_name, folder.resolve()) for folder in dict.fromkeys(folders))
    file = next((file for file in own if file is not None), None)
    if file is not None:
        return file
    known = getattr(sys.modules.get(module_name), "__file__", None)
    if known:
        return Path(known)
    top, _, rest = module_name.partition(".")
    spec = importlib.machinery.PathFinder.find_spec(top)
    if spec is None or not rest:
        return Path(spec.origin) if spec is not None and spec.origin else None
    within = (Path(place) for place in spec.submodule_search_locations or ())
    found = (_file_of(rest, place) for place in within)
    return next((file for file in found if file is not None), None)


def _file_of(module_name: str, folder: Path) -> Path | None:
    base = folder.joinpath(*module_name.split("."))
    files = (base.with_name(f"{base.name}.py"), base / "__init__.py")
    return next((file for file in files if file.is_file()), None)


def _from_file(module_name: str, file: Path, folder: Path) -> ModuleType:
    """Import the module in a file, under its own name unless another module has that name."""
    present = sys.modules.get(module_name)
    if present is None:
        # At the end of the path, so that a file beside a graph never hides an installed package.
        if str(folder) not in sys.path:
            sys.path.append(str(folder))
            importlib.invalidate_caches()
        if _is_importable(module_name.partition(".")[0], folder):
            return import_module(module_name)
    if present is not None and _same_file(present, file):
        return present
    return _import_file(f"{module_name}@{file.parent}", file)


def _is_importable(top: str, folder: Path) -> bool:
    """Return whether importing ``top`` gives the module or package in that folder, and no other."""
    try:
        spec = importlib.util.find_spec(top)
    except ValueError:  # a module without a spec, such as __main__
        return False
    if spec is None:
        return False
    places = [*(spec.submodule_search_locations or ()), spec.origin or ""]
    ours = (folder / top, folder / f"{top}.py")
    return any(Path(place).resolve() in ours for place in places if place)


def _same_file(module: ModuleType, file: Path) -> bool:
    origin = getattr(module, "__file__", None)
    return origin is not None and Path(origin).resolve() == file


def _import_file(key: str, file: Path) -> ModuleType:
    """Import a file whose module name another file has taken, under the name ``key``."""
    if key in sys.modules:
        return sys.modules[key]
    spec = importlib.util.spec_from_file_location(key, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[key] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[key]
        raise _import_error(file.stem, error) from error
    return module


def _import_error(module_name: str, error: BaseException) -> AloftError:
    """Return the error to raise for a module that could not be imported: it is missing, or it
    failed."""
    last = traceback.format_exception_only(error)[-1].strip()
    if isinstance(error, SyntaxError):
        return BlockImportError(last, f"{error.filename}:{error.lineno}:{error.offset}")
    if isinstance(error, ModuleNotFoundError) and f"{module_name}.".startswith(f"{error.name}."):
        return UnknownModuleError(f"there is no module {module_name!r}")
    frames = traceback.extract_tb(error.__traceback__)
    outside = [f for f in frames if "importlib" not in f.filename and f.filename != __file__]
    where = f"{outside[-1].filename}:{outside[-1].lineno}" if outside else ""
    return BlockImportError(last, where)
