"""``aloft language-server``: graph files in an editor, with problems while typing, hovers and go-to-block.

It speaks the Language Server Protocol on standard input and output (extra ``editor``). What it says comes from the
checks of ``aloft check`` and the declarations of the blocks. It imports no module of the workspace: a file that is
opened runs nothing. Of a user's own blocks it knows the text of their source; ``aloft check`` examines their wires.
"""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....cli.shared.output import errors_reported
from ....files.document import read_value
from ....files.nodes import ListNode, MapNode, Node
from ....files.pip_line import pip_line
from ....files.problems import LoadError, Position, Problem, Problems
from ....runtime.language.block import Block
from ....runtime.language.errors import AloftError
from ....runtime.language.importing import NOT_IMPORTED, find_source, without_imports
from ....runtime.loading.reading.files import PREFIX, graph_path

if TYPE_CHECKING:
    from pygls.lsp.server import LanguageServer

    from ....runtime.language.flat_graph import FlatBlock, FlatGraph
    from ....runtime.language.reference import BlockReference

WORD = re.compile(r"[\w.:/*-]+")
KEYS = ("rate:", "blocks:", "include:", "inputs:", "wires:")
"""A file with one of these at the start of a line is taken for a graph."""


def language_server() -> None:
    """Serve editors: problems while typing, units on hover, go to a block (extra editor)."""
    with errors_reported(False):
        make_server().start_io()


def problems_of(text: str, path: Path) -> tuple[Problem, ...]:
    """Return the problems that ``aloft check`` would report on the text if it were the file
    ``path``, but for those that are seen only when a user's own module is imported."""
    from ....runtime.loading.checked import checked_text

    try:
        with without_imports():
            checked_text(text, path)
    except LoadError as error:
        return tuple(p for p in error.report.problems if NOT_IMPORTED not in p.message)
    except AloftError as error:
        from ....files.problems import Code

        return (Problem(Code.FILE, str(error), Position(str(path), 1, 1)),)
    return ()


@dataclass(frozen=True)
class Cursor:
    """The place of the cursor in a text: the ``word`` under it, and the keys that lead to it,
    outermost first."""

    word: str
    keys: tuple[str, ...]

    @classmethod
    def at(cls, text: str, line: int, column: int) -> Cursor:
        """Find the place at a line and column counted from one."""
        lines = text.splitlines()
        row = lines[line - 1] if line <= len(lines) else ""
        found = (m[0] for m in WORD.finditer(row) if m.start() < column <= m.end() + 1)
        tree = read_value(text, "", Problems())
        keys = _keys(tree, (line, column)) if tree is not None else ()
        return cls(next(found, "").rstrip(":"), keys)

    @property
    def block(self) -> str:
        """The block in whose entry the cursor is."""
        return self.keys[1] if len(self.keys) > 1 and self.keys[0] == "blocks" else ""


def _keys(node: Node, at: tuple[int, int]) -> tuple[str, ...]:
    """Return the keys on the way to the value, or the key, that begins last before a place."""
    if isinstance(node, MapNode):
        before = [e for e in node if (e.key_where.line, e.key_where.column) <= at]
        return (before[-1].key, *_keys(before[-1].value, at)) if before else ()
    if isinstance(node, ListNode):
        items = [i for i in node.items if (i.where.line, i.where.column) <= at]
        return _keys(items[-1], at) if items else ()
    return ()


class GraphText:
    """The graph that a text describes, as far as it can be read.

    Args:
        text: of the graph file, saved or not.
        path: of the file; what it names is searched for beside it.
    """

    def __init__(self, text: str, path: Path) -> None:
        from ....runtime.loading.flattening.flatten import flatten_text

        self.text, self.path = text, path
        self.graph: FlatGraph = flatten_text(text, path, (), Problems())

    def hover(self, line: int, column: int) -> str:
        """Describe the thing under the cursor, in Markdown; empty for an unknown one."""
        cursor = Cursor.at(self.text, line, column)
        if cursor.keys[-1:] == ("use",) or cursor.word in self._uses():
            if ":" in cursor.word:
                own = _class_in_source(cursor.word, self.path.parent)
                return f"**{cursor.word}**\n\n{ast.get_docstring(own[1]) or ''}" if own else ""
            known = self._reference(cursor.word)
            return f"**{known.name}**\n\n{known.summary}" if known else ""
        block = self._block(cursor.block)
        if block is not None and len(cursor.keys) > 2 and cursor.word == cursor.keys[-1]:
            return self._declared(block, cursor.keys[2:])
        source, *fields = self._source(cursor.word)
        block = self._block(source)
        if block is None:
            return ""
        known = self._reference(block.use)
        port = (
            next((p for p in known.outputs if p.name == fields[0]), None)
            if known and fields
            else None
        )
        if port is None:
            return f"**{source}**: {block.use}" + (f"\n\n{known.summary}" if known else "")
        chosen = [f for f in port.fields if len(fields) < 2 or f.name == fields[1].split("[")[0]]
        return f"**{source}.{port.name}**: {port.text}\n" + "".join(
            f"\n- `{f.name}`: {f.type}. {f.text}" for f in chosen
        )

    def definition(self, line: int, column: int) -> Position | None:
        """Find the definition of the thing under the cursor: a block in its file, a class in
        Python, an included file."""
        cursor = Cursor.at(self.text, line, column)
        if cursor.word.endswith((".yaml", ".yml")) or cursor.word.startswith(PREFIX):
            file = graph_path(cursor.word, self.path.parent)
            return Position(str(file), 1, 1) if file.is_file() else None
        if cursor.keys[-1:] == ("use",):
            if ":" in cursor.word:
                return self._own_class(cursor.word)
            block_type = self._class(cursor.word)
            file_of = None if block_type is None else inspect.getsourcefile(block_type)
            if block_type is None or file_of is None:
                return None
            return Position(file_of, inspect.getsourcelines(block_type)[1], 1)
        block = self._block(self._source(cursor.word)[0])
        return None if block is None else block.where

    def _source(self, word: str) -> list[str]:
        """Split a word into the path of a block, the longest that there is, then its port and
        field."""
        parts = word.split(".")
        for count in range(len(parts), 0, -1):
            if self._block(".".join(parts[:count])) is not None:
                return [".".join(parts[:count]), *parts[count:]]
        return [word]

    def _block(self, path: str) -> FlatBlock | None:
        return next((block for block in self.graph.blocks if block.path == path), None)

    def _uses(self) -> set[str]:
        return {block.use for block in self.graph.blocks}

    def _class(self, use: str) -> type[Block] | None:
        from ....runtime.language.registry import find_block

        try:
            with without_imports():
                return find_block(use, self.path.parent)
        except AloftError:
            return None

    def _own_class(self, use: str) -> Position | None:
        """Find a class of a user's module in its source."""
        found = _class_in_source(use, self.path.parent)
        return None if found is None else Position(str(found[0]), found[1].lineno, 1)

    def _reference(self, use: str) -> BlockReference | None:
        from ....runtime.language.reference import block_reference

        found = self._class(use)
        return None if found is None else block_reference(use, found)

    def _declared(self, block: FlatBlock, keys: tuple[str, ...]) -> str:
        """Return the text of a parameter or an input of a block."""
        known = self._reference(block.use)
        if known is None or len(keys) < 2:
            return ""
        if keys[0] == "with":
            for parameter in known.parameters:
                if parameter.name == keys[1]:
                    unit = f" [{parameter.unit}]" if parameter.unit else ""
                    told = f"default {parameter.default}" if parameter.default else "required"
                    bounds = f", {parameter.bounds}" if parameter.bounds else ""
                    return (
                        f"**{parameter.name}**{unit}: {parameter.full_text}\n\n"
                        f"`{parameter.type}`, {told}{bounds}"
                    )
        for port in known.inputs if keys[0] == "in" else ():
            if port.name == keys[1]:
                return f"**{port.name}**: {port.text}\n" + "".join(
                    f"\n- `{f.name}`: {f.type}. {f.text}" for f in port.fields
                )
        return ""


def _class_in_source(use: str, folder: Path) -> tuple[Path, ast.ClassDef] | None:
    """Return the file of ``module:Class`` and the class in it; nothing is imported."""
    module, _, name = use.partition(":")
    file = find_source(module, (folder, Path()))
    try:
        tree = ast.parse(file.read_bytes()) if file is not None else ast.Module([], [])
    except (OSError, SyntaxError, ValueError, RecursionError):
        return None
    classes = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name)
    found = next(classes, None)
    return None if found is None or file is None else (file, found)


def make_server() -> LanguageServer:
    """Make the server, which has not begun to read.

    Raises:
        AloftError: the extra ``editor`` is not installed.
    """
    try:
        from lsprotocol import types
        from pygls.lsp.server import LanguageServer
        from pygls.uris import from_fs_path, to_fs_path
    except ModuleNotFoundError as error:
        raise AloftError(f"the language server needs pygls: {pip_line('editor')}") from error
    from .... import __version__

    server = LanguageServer("aloft", __version__, types.TextDocumentSyncKind.Full)

    def place(position: Position) -> Any:
        at = types.Position(max(0, position.line - 1), max(0, position.column - 1))
        end = types.Position(at.line, at.character + 1)
        return types.Range(at, end)

    def opened(uri: str) -> tuple[str, Path]:
        return server.workspace.get_text_document(uri).source, Path(to_fs_path(uri) or "")

    def graph_at(uri: str) -> GraphText | None:
        text, path = opened(uri)
        return GraphText(text, path) if is_graph(text) else None

    def publish(uri: str) -> None:
        text, path = opened(uri)
        found = problems_of(text, path) if is_graph(text) else ()
        shown = []
        for problem in found:
            here = problem.where.file == str(path)
            details = [f"{label}: {said}" for label, said in problem.lines()]
            message = problem.message if here else f"{problem.where}: {problem.message}"
            where = problem.where if here else Position(str(path), 1, 1)
            shown.append(
                types.Diagnostic(
                    place(where), "\n".join([message, *details]),
                    severity=types.DiagnosticSeverity.Error, code=str(problem.code), source="aloft",
                )
            )  # fmt: skip
        server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, shown))

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def did_open(params: types.DidOpenTextDocumentParams) -> None:
        publish(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def did_change(params: types.DidChangeTextDocumentParams) -> None:
        publish(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_HOVER)
    def hover(params: types.HoverParams) -> types.Hover | None:
        graph = graph_at(params.text_document.uri)
        text = graph and graph.hover(params.position.line + 1, params.position.character + 1)
        return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, text)) if text else None

    @server.feature(types.TEXT_DOCUMENT_DEFINITION)
    def definition(params: types.DefinitionParams) -> types.Location | None:
        graph = graph_at(params.text_document.uri)
        at, column = params.position, params.position.character + 1
        where = graph.definition(at.line + 1, column) if graph is not None else None
        if where is None:
            return None
        uri = from_fs_path(str(Path(where.file).absolute()))
        return types.Location(uri or "", place(where))

    return server


def is_graph(text: str) -> bool:
    """Tell whether a YAML text looks like a graph file."""
    return any(line.startswith(KEYS) for line in text.splitlines())
