"""Reports every block that cannot work with the graph's robot, or with the graph itself."""

from __future__ import annotations

from collections.abc import Mapping

from ...language.block import Clock, Context, Misfit
from ...language.fit import find_misfits, unmet_needs
from ..problems import Code, Problems
from ..reading.nodes import ListNode, MapNode, Node
from .draft import Draft
from .settings import Settings


def lacks_robot(draft: Draft, settings: Settings) -> bool:
    """Whether the block needs something of a robot that the graph's robot does not have."""
    assert draft.block_type is not None
    return bool(unmet_needs(draft.block_type, settings.robot))


def check_fit(draft: Draft, settings: Settings, problems: Problems) -> Mapping[str, str]:
    """Report every misfit of one block, whose parameters have been checked.

    Returns:
        The outputs that this robot cannot have, each with the reason.
    """
    assert draft.block_type is not None and draft.params is not None
    flat = draft.flat
    context = Context(
        path=flat.path,
        clock=Clock(1.0 / (settings.base_rate or 1.0)),
        period_ticks=draft.period_ticks,
        offset_ticks=draft.offset_ticks,
        dimensions=draft.dimensions,
        robot=settings.robot,
        wired=tuple(flat.wires),
        folder=flat.folder,
        graph_folder=settings.folder,
    )
    misfits = find_misfits(draft.block_type, draft.params, context)
    for misfit in misfits:
        report_misfit(draft, misfit, problems)
    return {} if misfits else draft.block_type.absent_outputs(draft.params, settings.robot)


def report_misfit(draft: Draft, misfit: Misfit, problems: Problems) -> None:
    """Report a misfit at the parameter it concerns, or else at the block."""
    flat = draft.flat
    steps = misfit.parameter.split(".") if misfit.parameter else []
    node: Node = flat.parameters
    where = flat.where
    for step in steps:
        found = _inside(node, step)
        if found is None:
            break
        node, where = found, found.where
    problems.add(
        Code.MISFIT,
        f"{flat.path} ({flat.use}): {misfit.message}",
        where,
        at=".".join([flat.path, *steps]),
        expected=misfit.expected,
        found=misfit.found,
        nearest=misfit.nearest,
        fix=misfit.fix,
    )


def _inside(node: Node, step: str) -> Node | None:
    """The value under a key, or the element at an index."""
    if isinstance(node, MapNode):
        entry = node.get(step)
        return entry.value if entry else None
    if isinstance(node, ListNode) and step.isdigit() and int(step) < len(node.items):
        return node.items[int(step)]
    return None
