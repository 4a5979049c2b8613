"""Finds extensions: folders of blocks, verbs and services that can be taken away.

An extension is a folder with a file ``extension.toml``, which is read without importing anything:

* ``extensions/NAME`` of aloft, and ``lab`` of a checkout;
* the package of another wheel that an entry point of the group ``aloft.extensions`` names.

The name of the folder, or of the entry point, is the name under which graphs find its blocks:
``hopping.SteeredPlan``. What the core asks of an extension has a name as well, such as ``diagram``; the
declaration says which function gives it, and ``provided`` imports it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from .errors import AloftError

DECLARATION = "extension.toml"
ENTRY_POINTS = "aloft.extensions"
"""The group in which other packages announce extensions."""
KEYS = {
    "summary": str, "page": str, "extras": list, "needs": list, "verbs": dict, "help": dict, "provides": dict,
}  # fmt: skip
"""The keys of a declaration and the types of their values."""

SHIPPED: Mapping[str, tuple[str, ...]] = {
    "analysis": ("branch", "explain", "falsify", "linearise", "sensitivity", "trim", "tune"),
    "commissioning": (
        "robot scan", "robot status", "robot watch", "robot zero", "robot jog", "robot estop", "robot schema",
        "robot bring-up", "robot calibrate", "robot identify", "robot reach",
    ),
    "deployment": ("deploy", "keys", "top", "watch"),
    "export": ("export",),
    "hopping": ("steer",),
    "lab": ("bench",),
    "ros2": (),
    "studio": ("language-server",),
}  # fmt: skip
"""The extensions of aloft and their verbs, so that an error can name the one that is missing."""
SERVICES: Mapping[str, str] = {
    "diagram_page": "studio",
    "diagram_png": "studio",
    "diagram_svg": "studio",
    "live_page": "studio",
    "mcap_channels": "ros2",
    "study_paper": "lab",
}
"""Services that the core requests from extensions, each with the extension of aloft that has it."""

FROM_SOURCE = "install aloft from a clone of its repository instead: pip install --editable ."

_PACKAGE = __name__.rpartition(".runtime.")[0]


def is_own(module: str) -> bool:
    """Return whether a module is aloft's own, which its tests check, and no user's."""
    return module.startswith(f"{_PACKAGE}.")


_ROOT = Path(__file__).parents[2]


class ExtensionError(AloftError):
    """A declaration is wrong, or an extension that is needed is missing."""


@dataclass(frozen=True)
class Extension:
    """The declaration of an extension."""

    name: str
    folder: Path
    package: str
    """The name under which Python imports the folder."""
    summary: str = ""
    page: str = ""
    """The page about it, a file in its folder."""
    extras: tuple[str, ...] = ()
    """The extras of the distribution that it needs, or parts of it."""
    needs: tuple[str, ...] = ()
    """Other extensions that it imports."""
    verbs: Mapping[str, str] = field(default_factory=dict)
    """The verbs of the command line, each with ``module:name``; ``robot reach`` is one of the group ``robot``."""
    help: Mapping[str, str] = field(default_factory=dict)
    """The panel and the summary of verbs: ``Recordings: Say why a run failed.``"""
    provides: Mapping[str, str] = field(default_factory=dict)
    """The services, each with ``module:name``."""

    def load(self, target: str) -> Any:
        """Import what ``module:name`` names; the module counts from the extension's folder."""
        module, _, name = target.partition(":")
        return getattr(import_module(f"{self.package}.{module}"), name)


def read_declaration(name: str, folder: Path, package: str) -> Extension:
    """Read the declaration of an extension.

    Raises:
        ExtensionError: it is no TOML, or has an unknown key or a value of another type.
    """
    import tomllib

    file = folder / DECLARATION
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ExtensionError(f"{file}: {error}") from error
    for key, value in found.items():
        if key not in KEYS:
            raise ExtensionError(f"{file}: unknown key {key!r}; there is {', '.join(KEYS)}")
        texts = value.values() if isinstance(value, dict) else value
        if not isinstance(value, KEYS[key]) or not all(isinstance(text, str) for text in texts):
            raise ExtensionError(f"{file}: {key}: expected {_EXPECTED[KEYS[key]]}, found {value!r}")
    return Extension(
        name, folder, package, found.get("summary", ""), found.get("page", ""),
        tuple(found.get("extras", ())), tuple(found.get("needs", ())), found.get("verbs", {}),
        found.get("help", {}), found.get("provides", {}),
    )  # fmt: skip


_EXPECTED = {str: "a text", list: "a list of texts", dict: "a table of texts"}


@cache
def own_extensions() -> Mapping[str, Extension]:
    """Return the extensions that lie in this installation of aloft, by name."""
    return {
        name: read_declaration(name, folder, f"{_PACKAGE}.{'.'.join(parts)}")
        for name in SHIPPED
        for parts in [("lab",) if name == "lab" else ("extensions", name)]
        for folder in [_ROOT.joinpath(*parts)]
        if (folder / DECLARATION).is_file()
    }


@cache
def other_extensions() -> Mapping[str, Extension]:
    """Return the extensions of other installed packages, by name.

    Raises:
        ExtensionError: a package cannot be found, or its declaration is missing or wrong.
    """
    from importlib import metadata  # a twentieth of a start

    found = {}
    for point in metadata.entry_points(group=ENTRY_POINTS):
        spec = find_spec(point.value)
        if spec is None or not spec.submodule_search_locations:
            raise ExtensionError(f"extension {point.name!r}: there is no package {point.value!r}")
        folder = Path(next(iter(spec.submodule_search_locations)))
        found[point.name] = read_declaration(point.name, folder, point.value)
    return found


def extension(name: str) -> Extension | None:
    """Return the extension of that name, or None; other packages are searched only if aloft has
    none."""
    return own_extensions().get(name) or other_extensions().get(name)


def extensions() -> Iterator[Extension]:
    """All extensions, those of aloft first."""
    yield from own_extensions().values()
    yield from other_extensions().values()


def missing_extension(name: str, what: str) -> str:
    """Return the sentence that names the extension of a missing thing."""
    if name == "lab":
        return f"{what} is part of the lab, which is not in the wheel; {FROM_SOURCE}"
    return (
        f"{what} is part of the extension {name!r}, which is not here: its folder extensions/{name} is missing; "
        "install aloft again to have it back"
    )


def provided(service: str) -> Any:
    """Import what an extension provides under a name.

    Raises:
        ExtensionError: no extension does.
    """
    for each in extensions():
        if service in each.provides:
            return each.load(each.provides[service])
    raise ExtensionError(missing_extension(SERVICES[service], f"the service {service!r}"))


def is_provided(service: str) -> bool:
    """Return whether an extension provides that."""
    return any(service in each.provides for each in extensions())
