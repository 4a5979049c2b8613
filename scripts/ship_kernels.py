"""Compiles the kernels of all shipped graphs for x86-64 and aarch64, for a wheel to bring along.

    python scripts/ship_kernels.py [--triple TRIPLE] [GRAPH ...]

It writes one archive for each kind of processor into ``mathematics/compiling/`` of the ``aloft`` that Python
imports, beside the sources that the machine code was made of. ``scripts/release.sh`` runs it on what it
builds the wheel of.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import aloft
from aloft.files.problems import LoadError
from aloft.mathematics.compiling import shipped
from aloft.mathematics.compiling.arguments import type_of
from aloft.runtime.language.errors import AloftError
from aloft.runtime.running.memory import BoundGraph

GRAPHS = Path(aloft.__file__).parent / "graphs"
TRIPLES = ("x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu")


def kernels_of(graphs: Iterable[Path]) -> list[shipped.Kernel]:
    """Return the kernels that graphs call, each once for each choice of types. Files that are no
    whole graphs, and graphs whose devices are not there, are left out, and named."""
    found: dict[tuple[str, str], shipped.Kernel] = {}
    for path in graphs:
        try:
            bound = BoundGraph(aloft.load(path).checked)
        except (LoadError, AloftError, OSError, ImportError) as error:
            print(f"{path.name} is left out: {str(error).splitlines()[0]}", file=sys.stderr)
            continue
        for call in bound.kernel_calls:
            types = tuple(map(type_of, call.arguments))
            found.setdefault((call.name, str(list(map(str, types)))), (call.kernel, types))
    return list(found.values())


def main() -> None:
    """Write the archives."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("graphs", nargs="*", type=Path, metavar="GRAPH")
    parser.add_argument("--triple", action="append", choices=TRIPLES)
    chosen = parser.parse_args()
    shipped_graphs = sorted((*GRAPHS.glob("*.yaml"), *GRAPHS.glob("robots/*.yaml")))
    kernels = kernels_of(chosen.graphs or shipped_graphs)
    for triple in chosen.triple or TRIPLES:
        file = shipped.write(kernels, triple)
        print(f"{file.name}: {len(kernels)} kernels, {file.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
