"""``aloft graphs``: the graphs that are installed with aloft."""

from __future__ import annotations

from .shared.options import AsJson
from .shared.output import console, print_json, say, table


def graphs(
    as_json: AsJson = False,
) -> None:
    """List the shipped graphs by the addresses that every verb takes: aloft run aloft:jump."""
    from ..runtime.loading.reading.files import shipped_graphs, summary

    found = [(address, str(path), summary(path)) for address, path in shipped_graphs().items()]
    if as_json:
        keys = ("graph", "file", "summary")
        print_json({"graphs": [dict(zip(keys, row, strict=True)) for row in found]})
        return
    out = console()
    out.print(table("", ("graph", "what it does"), [(row[0], row[2]) for row in found]))
    say(out, "aloft run aloft:jump runs one; aloft graph aloft:jump --flat prints it whole")
