"""Loops over arrays, assignments by masks, and arguments by name, in terms of what kernels compile."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from .array_functions import ArrayFunctions
from .expressions import cloned
from .kernel_registry import arguments_of, is_kernel
from .kinds import NUMBER, ArrayKind, Kind
from .slices import called, plus


class ArrayLoops(ArrayFunctions):
    """Rewrites the statements that go through arrays."""

    _depth: int
    """The number of loops around the present statement."""

    def body(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Rewrite some statements that follow each other."""
        raise NotImplementedError

    def _note(self, target: ast.expr, kind: Kind) -> None:
        """Note the kind of a name."""
        raise NotImplementedError

    def _assign(self, node: ast.Assign, target: ast.expr) -> list[ast.stmt]:
        """Rewrite an assignment to one target."""
        raise NotImplementedError

    def _for(self, node: ast.For) -> list[ast.stmt]:
        before = self._loop_over(node)
        node.iter = self._expression(node.iter)
        self._note(node.target, NUMBER)
        self._depth += 1
        node.body, node.orelse = [*before, *self.body(node.body)], self.body(node.orelse)
        self._depth -= 1
        return [node]

    def _loop_over(self, node: ast.For) -> list[ast.stmt]:
        """Let a loop over arrays, ``enumerate`` or ``zip`` go over ``range``; returns what its body begins
        with."""
        streams: list[tuple[ast.expr, ast.expr]] = []
        counters: list[tuple[ast.expr, ast.expr | None]] = []

        def split(target: ast.expr, source: ast.expr) -> bool:
            if isinstance(source, ast.Call) and {each.arg for each in source.keywords} <= {
                "strict"
            }:
                function = self._resolved(source.func)
                targets = target.elts if isinstance(target, ast.Tuple) else []
                if function is enumerate and len(targets) == 2 and 1 <= len(source.args) <= 2:
                    counters.append((targets[0], source.args[1] if source.args[1:] else None))
                    return split(targets[1], source.args[0])
                if function is zip and len(targets) == len(source.args):
                    return all(split(t, s) for t, s in zip(targets, source.args, strict=True))
                if function is range and len(source.args) == 1 and target is not node.target:
                    counters.append((target, None))
                    lengths.append(self._expression(source.args[0]))
                    return True
            if isinstance(source, ast.Tuple | ast.List) and source.elts:
                source = self._made_array(ast.copy_location(ast.Call(source, [source], []), source))
            if not self._is_array(source):
                return False
            if not isinstance(source, ast.Name | ast.Attribute | ast.Subscript):
                source = self._new_array(source)
            streams.append((target, source))
            return True

        lengths: list[ast.expr] = []
        if not split(node.target, node.iter) or not streams:
            return []
        sizes = []
        for _, source in streams:
            size = self._size_of(source, 0)
            if size is None:
                raise self._error(node, f"the size of {ast.unparse(source)} is not known")
            sizes.append(size)
        sizes += lengths
        known = [size.value for size in sizes if isinstance(size, ast.Constant)]
        length = sizes[0]
        if len(known) == len(sizes):
            length = ast.Constant(min(known))  # type: ignore[type-var]  # numbers
        else:
            for size in sizes[1:]:
                length = called("min", length, size)
        first, start = counters[0] if counters else (None, None)
        name = self._name("i") if not isinstance(first, ast.Name) or start is not None else first.id
        before: list[ast.stmt] = []
        for target, begin in counters:
            if not isinstance(target, ast.Name):
                raise self._error(node, "a counter is a name")
            if target.id != name:
                place: ast.expr = ast.Name(name, ast.Load())
                value = place if begin is None else plus(self._expression(begin), place)
                before.append(ast.Assign([ast.Name(target.id, ast.Store())], value))
                self._note(target, NUMBER)
        self._kinds[name] = NUMBER
        for target, source in streams:
            part = ast.Subscript(cloned(source), ast.Name(name, ast.Load()), ast.Load())
            for each in ast.walk(part):
                if not hasattr(each, "lineno"):
                    ast.copy_location(each, node)
            plain = ast.copy_location(ast.Assign([target], part), node)
            before += self._assign(plain, target)
        for statement in before:
            for each in ast.walk(statement):
                if not hasattr(each, "lineno"):
                    ast.copy_location(each, node)
        node.target = ast.copy_location(ast.Name(name, ast.Store()), node)
        node.iter = ast.copy_location(called("range", length), node)
        for each in ast.walk(node.iter):
            ast.copy_location(each, node)
        return before

    def _mask_of(self, target: ast.expr) -> ast.expr | None:
        """Return the mask in ``y[mask] = ...``."""
        if isinstance(target, ast.Subscript) and not isinstance(
            target.slice, ast.Slice | ast.Tuple
        ):
            whole, kind = self._kind(target.value), self._kind(target.slice)
            flags = isinstance(kind, ArrayKind) and kind.element is bool and kind.rank > 0
            if flags and isinstance(whole, ArrayKind):
                if whole.rank != kind.rank:  # type: ignore[union-attr]  # an array
                    raise self._error(target, "a mask has as many dimensions as what it selects of")
                return target.slice
        return None

    def _masked(
        self, node: ast.stmt, target: ast.Subscript, mask: ast.expr, value: ast.expr
    ) -> list[ast.stmt]:
        """``y[mask] = value``, where the value may have ``x[mask]`` with the same mask."""
        text = ast.dump(mask)

        class Selected(ast.NodeTransformer):
            def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
                return node.value if ast.dump(node.slice) == text else self.generic_visit(node)

        plain = any(
            isinstance(e, ast.Subscript) and ast.dump(e.slice) == text for e in ast.walk(value)
        )
        value = Selected().visit(value)
        if not plain and self._is_array(value):
            raise self._error(
                node, f"{ast.unparse(target)} takes a number, or elements of the same mask"
            )
        kind = self._kind(target.value)
        assert isinstance(kind, ArrayKind)
        whole = ast.Tuple([ast.Slice() for _ in kind.shape], ast.Load())
        written = ast.copy_location(ast.Subscript(target.value, whole, ast.Store()), node)
        return self._loops(node, written, value, cloned(mask))

    def _complete(self, node: ast.Call) -> None:
        """Put the arguments of a call of a kernel in their order, with those that are left out."""
        function = self._resolved(node.func)
        if is_kernel(function):
            node.args, node.keywords = self._by_position(node, function), []

    def _by_position(self, node: ast.Call, function: Any) -> list[ast.expr]:
        """Return the arguments of a call of a kernel in their order, with those that are left out."""
        names = arguments_of(function)
        given: dict[str, ast.expr] = dict(zip(names, node.args, strict=False))
        name = function.__qualname__
        if len(node.args) > len(names):
            raise self._error(
                node, f"{name} takes {len(names)} arguments, and gets {len(node.args)}"
            )
        for each in node.keywords:
            if each.arg is None or each.arg not in names:
                raise self._error(
                    node, f"{name} has no argument {each.arg!r}; it has {', '.join(names)}"
                )
            if each.arg in given:
                raise self._error(node, f"{name} gets {each.arg!r} twice")
            given[each.arg] = each.value
        defaults = function.__defaults__ or ()
        for place, default in zip(names[len(names) - len(defaults) :], defaults, strict=True):
            if place not in given:
                if not isinstance(default, bool | int | float):
                    raise self._error(node, f"{name}: the default of {place!r} is no number")
                given[place] = ast.copy_location(ast.Constant(default), node)
        missing = [each for each in names if each not in given]
        if missing and not any(isinstance(each, ast.Starred) for each in node.args):
            raise self._error(node, f"{name} also takes {', '.join(missing)}")
        return [given[each] for each in names if each in given]
