"""Settings for all tests."""

import compileall
import gc
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings

from aloft.cli import COLLECTED_AFTER

ROOT = Path(__file__).parent.parent
UNTRACKED = ("recordings", "build", "dist", "aloft_robotics.egg-info", "__pycache__", ".*", "*.zip")

# The same examples every time: what passes here passes there. No deadline: machines are shared.
# As the examples are always the same, more of them than show a mistake are only time.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, database=None, max_examples=40
)
settings.load_profile("repeatable")

# As for the command line: with Python's own limits a fifth of the time goes into looking for garbage
# among the modules and classes of everything that is tested.
gc.set_threshold(*COLLECTED_AFTER)


def pytest_configure(config: pytest.Config) -> None:
    """Compile the package once for all processes, as they keep no bytecode from the end of the collection
    on. And let each worker begin to collect all tests at another place. To rewrite the assertions takes
    twice as long as the rest of it, and a worker reads from the cache what another one has rewritten."""
    if config.args_source is not config.ArgsSource.TESTPATHS:
        return
    if not hasattr(config, "workerinput"):
        for folder in () if sys.dont_write_bytecode else ROOT.glob("[a-z]*/"):
            compileall.compile_dir(folder, quiet=2, rx=re.compile("/tests/"))
    else:
        folders = [ROOT / "tests", *ROOT.glob("extensions/*/tests"), ROOT / "lab" / "tests"]
        parts = sorted(
            part
            for folder in folders
            for kind in ("[a-z]*/", "test_*.py")
            for part in folder.glob(kind)
        )
        number, count = int(config.workerinput["workerid"][2:]), config.workerinput["workercount"]
        first = len(parts) * number // count
        config.args = [str(part) for part in (*parts[first:], *parts[:first])]


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The order of one collection, wherever it began."""
    items.sort(key=lambda item: item.path)


def pytest_collection_finish() -> None:
    """Exempt what is collected from searches for garbage: every paced run makes one before it starts,
    which would take half a second among the modules of all tests. And cache no bytecode from here on:
    tests write blocks anew within the second and with the length by which Python tells old from new."""
    _freeze()
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Exempt what the tests of a file have imported, too: the libraries that only some tests need have
    more objects than all the others together."""
    if nextitem is None or nextitem.path == item.path or len(sys.modules) < _modules + 100:
        return
    gc.collect()
    _freeze()


_modules = 0
"""The number of modules when objects were frozen last."""


def _freeze() -> None:
    global _modules
    gc.freeze()
    _modules = len(sys.modules)


@pytest.hookimpl(wrapper=True, optionalhook=True)
def pytest_xdist_auto_num_workers() -> Generator[None, int, int]:
    """One worker more than cores: a fifth of the tests' time is waiting for clocks and processes."""
    found = yield
    return found if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else found + 1


@pytest.fixture(scope="session")
def tracked_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tracked files, so that building touches nothing here."""
    source = tmp_path_factory.mktemp("source") / "some-folder"
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(*UNTRACKED, "scripts"))
    return source


@pytest.fixture(scope="session")
def wheel(tracked_files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of the tracked files."""
    return built("wheel", tracked_files, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def source_distribution(tracked_files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A source distribution of the tracked files."""
    return built("sdist", tracked_files, tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="session")
def build() -> Callable[[str, Path, Path], Path]:
    """Builds a "wheel" or an "sdist" of a checkout into a folder."""
    return built


def built(kind: str, source: Path, folder: Path) -> Path:
    """The one file that setuptools builds of a checkout into a folder."""
    code = f"from setuptools import build_meta; build_meta.build_{kind}({str(folder)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=source, check=True, capture_output=True)
    (file,) = folder.iterdir()
    return file


@pytest.fixture(scope="session")
def docs_script() -> Callable[[str], ModuleType]:
    """Imports a script of lab/pages/ by its name; it finds the other scripts beside it."""

    def imported(name: str) -> ModuleType:
        path = ROOT / f"{name if '/' in name else f'lab/pages/{name}'}.py"
        spec = importlib.util.spec_from_file_location(path.stem, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.path.insert(0, str(path.parent))
        try:
            spec.loader.exec_module(module)
        finally:
            sys.path.remove(str(path.parent))
        return module

    return imported
