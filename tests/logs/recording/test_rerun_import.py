"""Rerun imported name by name: the same names stand for the same things, and most of it is not loaded."""

import json
import subprocess
import sys
from typing import Any

NAMES = """
import importlib, json, sys
{first}
import rerun, rerun.archetypes, rerun.blueprint, rerun.components
loaded = sum(name.partition(".")[0] == "rerun" for name in sys.modules)
def names(package):
    module = importlib.import_module(package)
    listed = json.loads({listed!r}).get(package) or [
        name for name in dir(module)
        if name[0] != "_" and not isinstance(getattr(module, name), type(sys))
    ]
    return {{name: repr(getattr(module, name)).split(" at 0x")[0] for name in listed}}
packages = ("rerun", "rerun.archetypes", "rerun.blueprint", "rerun.components")
print(json.dumps({{"loaded": loaded, "names": {{package: names(package) for package in packages}}}}))
"""
LAZILY = "from aloft.logs.recording.rerun_import import import_rerun; import_rerun()"


def ran(first: str, listed: dict[str, list[str]]) -> Any:
    program = NAMES.format(first=first, listed=json.dumps(listed))
    found = subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True
    )
    assert found.returncode == 0, found.stderr
    return json.loads(found.stdout.splitlines()[-1])


def test_each_name_is_what_it_is_without_it_and_most_modules_wait() -> None:
    whole = ran("", {})
    waiting = ran(LAZILY, {package: list(names) for package, names in whole["names"].items()})
    assert waiting["names"] == whole["names"]
    assert len(whole["names"]["rerun"]) > 100
    assert waiting["loaded"] < 0.4 * whole["loaded"]


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    program = f"{LAZILY}; import rerun; rerun.nothing"
    found = subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True
    )
    assert "AttributeError" in found.stderr and "'nothing'" in found.stderr


def test_a_package_that_cannot_be_taken_apart_is_imported_as_a_whole() -> None:
    program = (
        "from aloft.logs.recording import rerun_import as lazy; import sys\n"
        "def broken(*_): raise ImportError('made in another way')\n"
        "lazy._PackageLoader.get_code = broken\n"
        "print(lazy.import_rerun().Scalars, len(sys.meta_path))"
    )
    found = subprocess.run(
        [sys.executable, "-c", program], check=False, capture_output=True, text=True
    )
    assert "rerun.archetypes.scalars.Scalars" in found.stdout, found.stderr
