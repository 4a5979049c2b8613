"""Identity of the parts of one graph, which must agree before they run together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import zip_longest

from ... import __version__
from ..language.code_digest import block_code
from ..placement.placed import PlacedGraph


@dataclass(frozen=True)
class Identity:
    """The lines of a part's graph, as its text, of its schema, which its blocks declare, and of the code of its
    blocks."""

    graph: tuple[str, ...]
    schema: tuple[str, ...]
    code: tuple[str, ...] = ()

    @classmethod
    def of(cls, placed: PlacedGraph) -> Identity:
        """Return the identity of a placed graph; it is the same for all of its parts."""
        graph = placed.graph
        schema = []
        for spec in graph.blocks:
            kind = f"{spec.block_type.__module__}:{spec.block_type.__qualname__}"
            schema.append(f"{spec.path}: {kind} on {spec.machine or 'no machine'}")
            schema.append(f"{spec.path}: every {spec.period_ticks} ticks from {spec.offset_ticks}")
            schema += [
                f"{spec.path}.{port}.{name}: {field.describe()}"
                for port, output in spec.block_type.outputs.items()
                for name, field in output.signal.fields.items()
            ]
        code = list(block_code(graph.blocks))
        if graph.robot is not None:
            code.append(f"robot {graph.robot.name}: {_hash([graph.robot.model_dump_json()])}")
        text = (f"aloft {__version__}", f"rate {graph.base_rate!r}", f"ticks {graph.ticks}")
        return cls((*text, *graph.text.splitlines()), tuple(schema), tuple(code))

    @property
    def graph_hash(self) -> str:
        """16 hexadecimal digits for the version, the rate, the duration and the text."""
        return _hash(self.graph)

    @property
    def schema_hash(self) -> str:
        """16 hexadecimal digits for blocks, machines, rates and the types of all outputs."""
        return _hash(self.schema)

    @property
    def code_hash(self) -> str:
        """16 hexadecimal digits for the source of all blocks, whichever machine they run on."""
        return _hash(self.code)

    @property
    def hashes(self) -> list[str]:
        """The three hashes."""
        return [self.graph_hash, self.schema_hash, self.code_hash]

    def difference(self, other: Identity, mine: str, others: str) -> str:
        """Describe the difference from ``other`` in one sentence; empty if there is none."""
        for what, here, there, ours, theirs in (
            ("graph", self.graph, other.graph, self.graph_hash, other.graph_hash),
            ("schema", self.schema, other.schema, self.schema_hash, other.schema_hash),
            ("code", self.code, other.code, self.code_hash, other.code_hash),
        ):
            if ours != theirs:
                own, foreign = _first_difference(here, there)
                return (
                    f"the {what} is {ours} on {mine} and {theirs} on {others}; the first "
                    f"difference is {own!r} on {mine}, {foreign!r} on {others}"
                    + ("; all machines need the same files" if what == "code" else "")
                )
        return ""


def _hash(lines: Sequence[str]) -> str:
    return blake2b("\n".join(lines).encode(), digest_size=8).hexdigest()


def _first_difference(here: Sequence[str], there: Sequence[str]) -> tuple[str, str]:
    for own, foreign in zip_longest(here, there, fillvalue="nothing"):
        if own != foreign:
            return own.strip(), foreign.strip()
    return "", ""
