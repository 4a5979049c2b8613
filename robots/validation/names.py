"""Checks that everything has one name of its own."""

from __future__ import annotations

from collections.abc import Mapping

from .draft import Draft

RESERVED = {"links": ("world",), "joints": ("base",), "contacts": ("floor",)}
"""Names that the models keep for themselves."""


def check_names(draft: Draft) -> None:
    """Report names that stand twice in one list, names without text and names that are taken."""
    for key, word in (("links", "link"), ("joints", "joint"), ("feet", "foot"),
                      ("contacts", "contact")):  # fmt: skip
        first: dict[str, int] = {}
        elements = draft.data.get(key)
        if not isinstance(elements, (list, tuple)):
            continue
        for k, element in enumerate(elements):
            name = element.get("name") if isinstance(element, Mapping) else None
            if not isinstance(name, str):
                continue
            path = (key, k, "name")
            if name in first:
                draft.add(
                    path, f"{word} {name!r} is there twice", f"another name than {word} "
                    f"{first[name] + 1}", f"name: {name}", f"name: {name}_2",
                )  # fmt: skip
            elif not name.strip():
                draft.add(path, f"{word} {k + 1} has an empty name", "a name", repr(name))
            elif name in RESERVED.get(key, ()):
                draft.add(
                    path, f"no {word} can be called {name!r}: the models use that name",
                    "another name", f"name: {name}", f"name: {name}_{word}",
                )  # fmt: skip
            first.setdefault(name, k)
