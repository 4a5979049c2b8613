"""Mistakes that people make in a description in YAML: seeded changes of its bytes or its values, of
the kinds of ``mistakes``."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import yaml

from .mistakes import WORDS, Change, cut, insert, lose_byte, misspelt

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""The fastest YAML writer: the one in C takes a tenth of the time."""
Data = dict[str, Any]
Holder = tuple[Any, Any]
"""A mapping or list, and the key or index of one of its values."""


def _data(change: Callable[[random.Random, Data], bool]) -> Change:
    """Wrap a change of the values; it returns false where there is nothing to change."""

    def changed(draw: random.Random, text: bytes) -> bytes | None:
        data = yaml.load(text, LOADER)
        return as_yaml(data) if change(draw, data) else None

    return changed


def as_yaml(data: Data) -> bytes:
    """Write a description's plain data as text."""
    text: str = yaml.dump(
        data, Dumper=DUMPER, sort_keys=False, default_flow_style=None, allow_unicode=True
    )
    return text.encode()


def _at(data: Any, path: tuple[Any, ...]) -> Iterator[Holder]:
    """Yield the holders of the values at a path, in which ``*`` is every key or index."""
    keys: list[Any] = []
    if isinstance(data, dict):
        keys = [*data] if path[0] == "*" else [path[0]] if path[0] in data else []
    elif isinstance(data, list):
        keys = [*range(len(data))] if path[0] == "*" else []
    for key in keys:
        if len(path) == 1:
            yield data, key
        else:
            yield from _at(data[key], path[1:])


def _one(*path: Any, new: Callable[[random.Random, Any], Any]) -> Change:
    """Return a change of one of the values at a path."""

    def change(draw: random.Random, data: Data) -> bool:
        places = [(holder, key) for holder, key in _at(data, path) if holder[key] is not None]
        if not places:
            return False
        holder, key = draw.choice(places)
        before = holder[key]
        holder[key] = new(draw, before)
        return bool(holder[key] != before)

    return _data(change)


def _all(*path: Any, factor: float) -> Change:
    """Return a change of all values at a path to another unit."""

    def change(_: random.Random, data: Data) -> bool:
        places = [*_at(data, path)]
        for holder, key in places:
            holder[key] = _scaled(holder[key], factor)
        return bool(places)

    return _data(change)


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_scaled(each, factor) for each in value]
    return factor * value if isinstance(value, (int, float)) else value


def _lose(*path: Any) -> Change:
    """Return a change that loses one of the values at a path."""

    def change(draw: random.Random, data: Data) -> bool:
        places = [*_at(data, path)]
        if places:
            holder, key = draw.choice(places)
            del holder[key]
        return bool(places)

    return _data(change)


def _double(key: str) -> Change:
    """Return a change that doubles an entry of a list."""

    def change(draw: random.Random, data: Data) -> bool:
        if not data.get(key):
            return False
        data[key].append(dict(draw.choice(data[key])))
        return True

    return _data(change)


def _misspell(draw: random.Random, data: Data) -> bool:
    holders = [data, *data["links"], *data["joints"], *data["profiles"].values()]
    holder = draw.choice([each for each in holders if each])
    key = draw.choice(sorted(holder))
    wrong = misspelt(draw, key)
    if wrong in holder:
        return False
    holder[wrong] = holder.pop(key)
    return True


def _swap_ends(draw: random.Random, data: Data) -> bool:
    joint = draw.choice(data["joints"])
    joint["parent"], joint["child"] = joint["child"], joint["parent"]
    return True


def _word(draw: random.Random, value: Any) -> Any:
    """Replace a number by a word."""
    if isinstance(value, list):
        k = draw.randrange(len(value))
        return [*value[:k], _word(draw, value[k]), *value[k + 1 :]]
    return draw.choice(WORDS)


def _indented(draw: random.Random, text: bytes) -> bytes:
    lines = text.split(b"\n")
    k = draw.randrange(1, len(lines) - 1)
    lines[k] = draw.choice((b" ", b"   ", b"\t")) + lines[k]
    return b"\n".join(lines)


YAML: dict[str, Change] = {
    "the file is cut": cut,
    "bytes that are no UTF-8": insert(b"\xff", b"\xe9", b"\xc3("),
    "a colon is lost": lose_byte(b":"),
    "a bracket is lost": lose_byte(b"]"),
    "another encoding than declared": lambda _, text: text.decode().encode("utf-16"),
    "a line is indented": _indented,
    "a link is lost": _lose("links", "*"),
    "a joint is lost": _lose("joints", "*"),
    "parent or child of a joint is lost": _lose("joints", "*", "parent"),
    "a mass is lost": _lose("links", "*", "mass"),
    "an inertia is lost": _lose("links", "*", "inertia"),
    "limits of a joint are lost": _lose("joints", "*", "limits"),
    "a key is lost": _lose("*"),
    "a link is there twice": _double("links"),
    "a joint is there twice": _double("joints"),
    "a link has another name": _one("links", "*", "name", new=lambda _, text: f"{text}_2"),
    "a joint of an unknown kind": _one(
        "joints", "*", new=lambda _, each: {**each, "kind": "revolute"}
    ),
    "a key is misspelt": _data(_misspell),
    "a mass that is no number": _one("links", "*", "mass", new=_word),
    "an inertia that is no number": _one("links", "*", "inertia", new=_word),
    "a place that is no number": _one("joints", "*", "origin", new=_word),
    "an axis that is no number": _one("joints", "*", "axis", new=_word),
    "a limit that is no number": _one("joints", "*", "limits", new=_word),
    "a place of two numbers": _one("joints", "*", "origin", new=lambda _, each: each[:-1]),
    "a negative mass": _one("links", "*", "mass", new=lambda _, value: -abs(value) or -1.0),
    "a negative inertia": _one("links", "*", "inertia", new=lambda _, v: [-abs(v[0]), *v[1:]]),
    "a mass of zero": _one("links", "*", "mass", new=lambda *_: 0.0),
    "an axis of zero": _one("joints", "*", "axis", new=lambda *_: [0.0, 0.0, 0.0]),
    "an inertia that no body has": _one("links", "*", "inertia", new=lambda _, v: [30.0, *v[1:]]),
    "one mass in grams": _one("links", "*", "mass", new=lambda _, value: 1e3 * value),
    "all masses in grams": _all("links", "*", "mass", factor=1e3),
    "inertias in kg mm²": _all("links", "*", "inertia", factor=1e6),
    "places in millimetres": _all("joints", "*", "origin", factor=1e3),
    "limits in degrees": _all("joints", "*", "limits", factor=57.29578),
    "limits of a joint swapped": _one("joints", "*", "limits", new=lambda _, each: each[::-1]),
    "parent and child swapped": _data(_swap_ends),
    "a negative effort": _one("profiles", "*", "peak_torque", new=lambda _, value: -value),
    "a negative speed limit": _one("profiles", "*", "no_load_speed", new=lambda _, value: -value),
    "a mesh that is not there": _one(
        "looks", "*", "meshes", "*", "file", new=lambda _, text: f"{text}.old"
    ),
}
"""Changes of a description in YAML, each by the name of the mistake."""
