"""Arrays that a loop of a kernel hands from round to round, and names that stand for arrays.

``T = T @ R`` makes a new array in each round. In compiled code that is the memory of the round before, which the
product still reads, so it reads a copy. A name that would keep an array of an earlier round is refused.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from .array_loops import ArrayLoops
from .kinds import ArrayKind


class CarriedArrays(ArrayLoops):
    """Keeps apart what rounds of a loop make."""

    def __init__(self, function: Any, file: str) -> None:
        super().__init__(function, file)
        self._depth = 0
        """The number of loops around the present statement."""
        self._own_of_loops: set[str] = set()
        """Names of arrays that a loop makes anew."""
        self._before_loop: list[ast.stmt] = []
        """Statements to put in front of the outermost loop around the present statement."""
        self._first_reads: dict[str, int] = {}
        """The first line of that loop in which a name is read."""
        self._made_in_loop: set[str] = set()
        """Names to which that loop assigns what is no part of another array."""

    def _look_through_loop(self, loop: ast.For | ast.While) -> None:
        """Note where an outermost loop reads names, and which of them it assigns."""
        self._first_reads, self._made_in_loop = {}, set()
        for each in ast.walk(loop):
            if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load):
                first = self._first_reads.get(each.id, each.lineno)
                self._first_reads[each.id] = min(first, each.lineno)
            elif isinstance(each, ast.Assign) and not self._root(each.value):
                self._made_in_loop |= _names_assigned(each.targets)

    def _keep_what_is_carried(self, node: ast.Assign) -> None:
        """``T = T @ R`` in a loop reads what the round before has made, in the memory that it writes: let it read a copy."""
        values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
        if all(self._root(each) or self._chooses(each) for each in values):
            return
        read = {each.id for each in ast.walk(node.value) if isinstance(each, ast.Name)}
        for name in sorted(_names_assigned(node.targets) & read):
            kind = self._kinds.get(name)
            if not isinstance(kind, ArrayKind) or not kind.rank:
                continue
            old = ast.copy_location(ast.Name(name, ast.Load()), node)
            ahead, self._ahead = self._ahead, self._before_loop
            copy = self._room(old, kind)
            self._ahead = ahead
            whole = ast.Tuple([ast.Slice() for _ in kind.shape], ast.Load())
            target = ast.Subscript(ast.Name(copy.id, ast.Load()), whole, ast.Store())
            for each in ast.walk(target):
                ast.copy_location(each, node)
            statement = ast.copy_location(ast.Assign([target], old), node)
            for made in self._loops(statement, target, old):
                self._put_ahead(made, node)
            for each in ast.walk(node.value):
                if isinstance(each, ast.Name) and each.id == name:
                    each.id = copy.id

    def _note_alias(self, node: ast.Assign, name: str, value: ast.expr) -> None:
        """Note that a name stands for an array, or a part of one."""
        self._aliases.pop(name, None)
        self._partial.discard(name)
        self._own_of_loops.discard(name)
        if not self._is_array(value):
            return
        if not isinstance(value, ast.Name | ast.Attribute | ast.Subscript):
            if self._depth and not self._chooses(value):
                self._own_of_loops.add(name)
            return
        made, root = self._own_of_loops, self._root(value)
        later = self._depth > 0 and root in self._made_in_loop - made
        read_before = self._first_reads.get(name, node.lineno) < node.lineno
        if later or (root in made and (isinstance(value, ast.Name) or read_before)):
            text = f"{name} would keep an array that the loop makes anew; make both before the loop"
            raise self._error(node, text)
        if isinstance(value, ast.Name) and value.id in self._own and self._depth:
            self._own_of_loops.add(name)
        path = self._path(value)
        if path and path != name:
            self._aliases[name] = path
            if (
                isinstance(value, ast.Subscript)
                or self._root(value) in self._partial
                or (isinstance(value, ast.Attribute) and value.attr == "T")
            ):
                self._partial.add(name)

    def _chooses(self, node: ast.expr) -> bool:
        """Return whether an expression hands on one of two arrays: ``a if flag else b``."""
        return isinstance(node, ast.IfExp) and not self._is_array(node.test)


def _names_assigned(targets: Sequence[ast.expr]) -> set[str]:
    """Return the names that stand by themselves among some targets."""
    found = [
        each for one in targets for each in (one.elts if isinstance(one, ast.Tuple) else [one])
    ]
    return {each.id for each in found if isinstance(each, ast.Name)}
