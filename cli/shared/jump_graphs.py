"""The shipped graphs in which robots jump."""

from __future__ import annotations

from pathlib import Path

from ...runtime.language.errors import AloftError


def graph_of(robot: str) -> Path:
    """The shipped graph in which a robot jumps.

    Raises:
        AloftError: there is none; the message names the robots that have one.
    """
    known = jump_graphs()
    if robot not in known:
        raise AloftError(
            f"--robot {robot}: no shipped graph lets it jump; there is one for "
            f"{', '.join(sorted(known))}. For another robot give your own: --graph FILE"
        )
    return known[robot]


def jump_graphs() -> dict[str, Path]:
    """The shipped graph in which each robot jumps, by the robot's name."""
    from ...runtime.loading.reading.files import PREFIX, shipped_graphs

    return {
        name.removeprefix(f"{PREFIX}robots/").removesuffix("_jump"): path
        for name, path in shipped_graphs().items()
        if name.endswith("_jump") and name.startswith(f"{PREFIX}robots/")
    } | {"bruce": shipped_graphs()[f"{PREFIX}jump"]}
