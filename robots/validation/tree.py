"""Checks that links and joints make one tree that hangs on the base, listed depth first."""

from __future__ import annotations

from ..parts import Joint
from .draft import Draft
from .faults import listing, nearest


def check_tree(draft: Draft) -> None:
    """Report links that no tree can hold: unknown, carried twice, in a ring or not connected."""
    links, base = draft.names("links"), draft.data.get("base")
    if not isinstance(base, str):
        return
    if base not in links:
        draft.unknown(("base",), "the base", base, "link", links)
    joints = draft.parts("joints", Joint)
    carrier: dict[str, Joint] = {}
    sound = base in links
    for k, joint in joints:
        for key, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                draft.unknown(
                    ("joints", k, key), f"the {key} of joint {joint.name}", link, "link", links
                )
                sound = False
        if joint.child == base:
            draft.add(
                ("joints", k, "child"), f"joint {joint.name} carries the base {base}",
                "a base that no joint carries", f"child: {base}",
                "swap the joint's parent and child, or name another base",
            )  # fmt: skip
            sound = False
        elif joint.child in carrier:
            draft.add(
                ("joints", k, "child"),
                f"link {joint.child} is carried by two joints, "
                f"{carrier[joint.child].name} and {joint.name}",
                "one joint that carries each link", f"child: {joint.child}",
            )  # fmt: skip
            sound = False
        carrier.setdefault(joint.child, joint)
    _check_connection(draft, links, base, carrier)
    if sound:
        _check_order(draft, base, [joint for _, joint in joints])


def _check_connection(draft: Draft, links: list[str], base: str, carrier: dict[str, Joint]) -> None:
    """Report rings, each once, and links that no joint carries."""
    told: list[str] = []
    for k, link in enumerate(links):
        if link == base:
            continue
        if link not in carrier:
            if not _unread_joint(draft):
                draft.add(
                    ("links", k), f"link {link} hangs on nothing: no joint carries it",
                    f"a joint with child: {link}", "none",
                )  # fmt: skip
            continue
        way = [link]
        while way[-1] in carrier and way[-1] != base and carrier[way[-1]].parent not in way:
            way.append(carrier[way[-1]].parent)
        last = carrier.get(way[-1])
        if way[-1] == base or last is None or link in told:
            continue
        ring = way[way.index(last.parent) :]
        if link in ring:
            told += ring
            names = [carrier[each].name for each in ring]
            draft.add(
                ("joints", _index(draft, names[0]), "parent"),
                f"joints {listing(names)} carry each other in a ring and do not hang on the base",
                f"a tree that hangs on {base}", " <- ".join([*ring, ring[0]]),
            )  # fmt: skip


def _unread_joint(draft: Draft) -> bool:
    """Whether some joint could not be read, so that links may seem to hang on nothing."""
    found = draft.data.get("joints")
    return not isinstance(found, (list, tuple)) or len(draft.parts("joints", Joint)) < len(found)


def _index(draft: Draft, name: str) -> int:
    return next(k for k, joint in draft.parts("joints", Joint) if joint.name == name)


def _check_order(draft: Draft, base: str, joints: list[Joint]) -> None:
    """Report the first joint that is not where a walk through the tree, branch by branch, has it."""
    walk: list[Joint] = []

    def visit(link: str) -> None:
        for joint in joints:
            if joint.parent == link:
                walk.append(joint)
                visit(joint.child)

    visit(base)
    if len(walk) < len(joints):
        return  # Not a tree; that is reported.
    for joint, right in zip(joints, walk, strict=True):
        if joint is not right:
            draft.add(
                ("joints", _index(draft, joint.name)),
                f"joint {joint.name} is listed where joint {right.name} belongs: joints are "
                "listed branch by branch, each behind the joint that carries its parent",
                "the order " + listing([each.name for each in walk], 40),
                "the order " + listing([each.name for each in joints], 40),
            )  # fmt: skip
            return


__all__ = ["check_tree", "nearest"]
