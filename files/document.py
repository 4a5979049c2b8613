"""Reads a YAML file into a tree with positions.

Scalars are read as in YAML 1.2, which is what people expect: ``1e-3`` is a number, ``010`` is ten,
``12:30``, ``on``, ``off``, ``yes`` and ``no`` are texts (the last four may also be given to a
parameter that is true or false). Anchors, aliases and merge keys (``<<``) work as usual. A repeated
key is a problem, and so is every syntax error.
"""

from __future__ import annotations

import codecs
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from .nodes import Entry, ListNode, MapNode, Node, Plain, ScalarNode
from .problems import Code, Position, Problems, nearest

_PREFIX = "tag:yaml.org,2002:"
_LIMIT = 200_000  # values in one file, counting an alias each time it is used
_DEPTH = 100  # levels of nesting; PyYAML's own composer overflows the stack on a hostile file
_TOO_DEEP = f"nested more than {_DEPTH} levels deep"
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # PyYAML is not typed

_PLAIN = re.compile(
    r"(?P<null>~|null|Null|NULL|)$"
    r"|(?P<bool>true|True|TRUE|false|False|FALSE)$"
    r"|(?P<int>[-+]?(?:[0-9][0-9_]*|0x[0-9a-fA-F_]+|0o[0-7_]+|0b[01_]+))$"
    r"|(?P<float>[-+]?(?:[0-9][0-9_]*(?:\.[0-9_]*)?|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$"
)
"""Pattern of a plain YAML 1.2 scalar (null, bool, number); any other unquoted scalar is a text."""
_FIRST = frozenset("-+0123456789.~nNtTfF")
"""The first characters of what ``_PLAIN`` matches, as most scalars are texts."""


GRAPH_FILE = ("a graph file", "rate, robot, blocks")


def read_file(
    path: Path,
    shown: str,
    problems: Problems,
    kind_of_file: tuple[str, str] = GRAPH_FILE,
    *,
    may_be_empty: bool = False,
) -> MapNode | None:
    """Return the mapping in a file, which messages call ``shown``; ``None`` after a problem.

    ``kind_of_file`` holds two texts for messages: the name of such a file and some of its keys.
    """
    try:
        data = path.read_bytes()
        text = data.decode("utf-8-sig")
    except OSError as error:
        reason = error.strerror or str(error)
        problems.add(Code.FILE, f"cannot read {shown}: {reason}", Position(shown, 0, 0))
        return None
    except UnicodeDecodeError as error:
        _report_encoding(data, error, shown, problems)
        return None
    return read_mapping(text, shown, problems, kind_of_file, may_be_empty=may_be_empty)


def _report_encoding(
    data: bytes, error: UnicodeDecodeError, shown: str, problems: Problems
) -> None:
    """Say which encoding a file seems to have, and where it is not UTF-8."""
    before = data[: error.start]
    line = before.count(b"\n") + 1
    column = len(before.rpartition(b"\n")[2].decode("utf-8", "replace")) + 1
    where, name = Position(shown, line, column), "ISO-8859-1"
    found = f"byte 0x{data[error.start]:02x}, in Latin-1 {chr(data[error.start])!r}"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in data[:64]:
        where, name, found = Position(shown, 1, 1), "UTF-16", "UTF-16"
    problems.add(
        Code.FILE,
        f"{shown} is not UTF-8 text",
        where,
        expected="text in UTF-8",
        found=found,
        fix=f"save it as UTF-8, or: iconv -f {name} -t UTF-8 {shown} > new.yaml",
    )


def read_mapping(
    text: str,
    shown: str,
    problems: Problems,
    kind_of_file: tuple[str, str] = GRAPH_FILE,
    *,
    may_be_empty: bool = False,
) -> MapNode | None:
    """Return the mapping in a YAML text; ``None`` after a problem."""
    before = len(problems)
    node = read_value(text, shown, problems)
    if isinstance(node, MapNode):
        return node
    if node is None and may_be_empty and len(problems) == before:
        return MapNode((), Position(shown, 1, 1))
    if len(problems) == before:
        found = "a list" if isinstance(node, ListNode) else "a single value"
        if node is None or (isinstance(node, ScalarNode) and node.value is None):
            found = "nothing"
        problems.add(
            Code.WRONG_KIND,
            f"{kind_of_file[0]} is a mapping",
            node.where if node else Position(shown, 1, 1),
            expected=f"keys such as {kind_of_file[1]}",
            found=found,
        )
    return None


def read_value(text: str, shown: str, problems: Problems) -> Node | None:
    """Return the one value in a YAML text; ``None`` for an empty text and after a problem."""
    node, found = _read(text, shown)
    problems.extend(found)
    return node


@lru_cache(maxsize=64)  # studies and tests load graphs that share most of their files many times
def _read(text: str, shown: str) -> tuple[Node | None, Problems]:
    """Return the value in a YAML text, and the problems of the text."""
    node, problems = None, Problems()
    try:
        loader = _Loader(_hide_brackets(text))
        try:
            node = _Composer(loader, shown, problems).compose()
        finally:
            loader.dispose()
    except _Rejected:
        pass
    except yaml.MarkedYAMLError as error:
        _report_syntax(error, text, shown, problems)
    except yaml.reader.ReaderError as error:
        before = text[: error.position] if isinstance(error.position, int) else ""
        where = Position(shown, before.count("\n") + 1, len(before.rpartition("\n")[2]) + 1)
        problems.add(Code.YAML, f"a character that YAML forbids: {error.reason}", where)
    except (yaml.YAMLError, ValueError) as error:
        message = str(error).splitlines()[0] if str(error) else type(error).__name__
        problems.add(Code.YAML, message, Position(shown, 1, 1))
    return node, problems


def _report_syntax(error: yaml.MarkedYAMLError, text: str, shown: str, problems: Problems) -> None:
    mark = error.problem_mark or error.context_mark
    line, column = (mark.line, mark.column) if mark else (0, 0)
    lines = text.splitlines()
    if line >= len(lines) and lines:  # at the end of the file: point behind the last character
        line = len(lines) - 1
        column = len(lines[line])
    other = None
    context = error.context_mark
    if context is not None and (context.line, context.column) != (line, column):
        other = Position(shown, context.line + 1, context.column + 1)
    message = error.problem or error.context or "this is not YAML"
    if "nesting depth" in message:  # libyaml's own limit, where it looks further ahead than we do
        message = _TOO_DEEP
    fix = ""
    if line < len(lines) and lines[line][column : column + 1] == "\t":
        message, fix, other = "a tab where YAML wants spaces", "indent with spaces", None
    elif "mapping values are not allowed" in message:
        fix = "indent the lines of one mapping alike; put text with a colon in quotes"
    elif any(part in message for part in ("expected ':'", "expected ',' or", "expected node")):
        fix = "close the bracket or quote, or add the missing colon or comma"
    elif "expected <block end>" in message or "did not find expected key" in message:
        fix = "indent the lines of one mapping alike"
    problems.add(
        Code.YAML,
        message,
        Position(shown, line + 1, column + 1),
        other=(error.context or "") if other else "",
        other_where=other,
        fix=fix,
    )


# YAML ends a plain text at a bracket or comma inside braces, so ``{u: e.y.value[0, 2]}`` would have
# to be quoted. While YAML is read, these characters of a selection are private ones of the same width.
_SOURCE = re.compile(r"(?<![\w./\]])[A-Za-z][\w/]*(?:\.[A-Za-z_]\w*){1,2}(?:\[[^\[\]{}#\"'\n]*\])+")
_HIDDEN = str.maketrans("[],", "\ue000\ue001\ue002")
_SHOWN = str.maketrans("\ue000\ue001\ue002", "[],")


def _hide_brackets(text: str) -> str:
    """Return the text with the brackets behind ``block.port`` hidden from YAML."""
    if "[" not in text:
        return text
    return _SOURCE.sub(lambda match: match[0].translate(_HIDDEN), text)


class _Rejected(Exception):
    """The file cannot be used as a whole; the problem has been noted."""


class _Composer:
    """Makes trees of nodes from libyaml's events; a node with an anchor is made once and shared."""

    def __init__(self, loader: Any, shown: str, problems: Problems) -> None:
        self.loader = loader
        self.shown = shown
        self.problems = problems
        self.anchors: dict[str, tuple[Node, int] | None] = {}  # None while still open
        self.depth = 0

    def compose(self) -> Node | None:
        """Return the only document's node."""
        self.loader.get_event()  # the stream's start
        if self.loader.check_event(yaml.StreamEndEvent):
            return None
        self.loader.get_event()  # the document's start
        node, _ = self._node(self.loader.get_event())
        self.loader.get_event()  # the document's end
        if not self.loader.check_event(yaml.StreamEndEvent):
            where = self._where(self.loader.peek_event())
            message = "a second document; a graph file holds one"
            self.problems.add(Code.YAML, message, where, fix="remove the --- and what follows it")
        return node

    def _where(self, event: Any) -> Position:
        mark = event.start_mark
        return Position(self.shown, mark.line + 1, mark.column + 1)

    def _reject(self, code: Code, message: str, where: Position) -> _Rejected:
        self.problems.add(code, message, where)
        return _Rejected()

    def _node(self, event: Any) -> tuple[Node, int]:
        where = self._where(event)
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:
                known = [name for name, node in self.anchors.items() if node]
                self.problems.add(
                    Code.YAML,
                    f"no anchor called &{event.anchor} before this alias",
                    where,
                    nearest=nearest(str(event.anchor), known),
                )
                return ScalarNode(None, where), 1
            shared = self.anchors[event.anchor]
            if shared is None:
                raise self._reject(Code.YAML, "an alias inside what it stands for", where)
            return shared
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        if isinstance(event, yaml.ScalarEvent):
            made: tuple[Node, int] = ScalarNode(self._scalar(event, where), where), 1
        else:
            made = self._collection(event, where)
        if made[1] > _LIMIT:
            message = f"more than {_LIMIT} values once the aliases are expanded"
            raise self._reject(Code.TOO_LARGE, message, where)
        if event.anchor is not None:
            self.anchors[event.anchor] = made
        return made

    def _collection(self, event: Any, where: Position) -> tuple[Node, int]:
        if event.tag not in (None, "!", _PREFIX + "seq", _PREFIX + "map"):
            self._unknown_tag(event.tag, where)
        self.depth += 1
        if self.depth > _DEPTH:
            raise self._reject(Code.YAML, _TOO_DEEP, where)
        made = self._list(where) if isinstance(event, yaml.SequenceStartEvent) else self._map(where)
        self.depth -= 1
        return made

    def _scalar(self, event: Any, where: Position) -> Plain:
        text: str = event.value
        if not text.isascii():
            text = text.translate(_SHOWN)
        if event.tag is None or event.tag == "!":
            if not event.implicit[0] or (text and text[0] not in _FIRST):
                return text
            match = _PLAIN.match(text)
            if match is None:
                return text
            tag = str(match.lastgroup)
        else:
            tag = event.tag.removeprefix(_PREFIX)
        if tag in ("str", "merge"):
            return text
        lowered = text.replace("_", "").lower()
        try:
            if tag == "null":
                return None
            if tag == "bool" and lowered in ("true", "false"):
                return lowered == "true"
            if tag == "int":
                based = lowered.lstrip("+-")[:2] in ("0x", "0o", "0b")
                return int(lowered, 0 if based else 10)
            if tag == "float":
                return float(lowered.replace(".inf", "inf").replace(".nan", "nan"))
        except ValueError:
            pass
        self._unknown_tag(event.tag or f"!!{tag}", where, text)
        return text

    def _unknown_tag(self, tag: str, where: Position, text: str = "") -> None:
        short = tag.replace(_PREFIX, "!!")
        if text and short in ("!!int", "!!float", "!!bool"):
            self.problems.add(Code.YAML, f"{text[:40]!r} cannot be read as {short}", where)
            return
        self.problems.add(
            Code.YAML, f"tag {short} means nothing here", where, fix="leave the tag out"
        )

    def _list(self, where: Position) -> tuple[ListNode, int]:
        items = []
        size = 1
        while not isinstance(event := self.loader.get_event(), yaml.SequenceEndEvent):
            item, item_size = self._node(event)
            items.append(item)
            size += item_size
        return ListNode(tuple(items), where), size

    def _map(self, where: Position) -> tuple[MapNode, int]:
        entries: dict[str, Entry] = {}
        merged: dict[str, Entry] = {}
        size = 1
        while not isinstance(key_event := self.loader.get_event(), yaml.MappingEndEvent):
            key_where = self._where(key_event)
            written = isinstance(key_event, yaml.ScalarEvent)
            # A key is always the text as it is written, also if that is `on`, `null` or `1`.
            key: object = key_event.value if written else None
            # Most keys are nothing but texts, and need no node.
            if (
                not written or key_event.anchor is not None or key_event.tag is not None
                or key_event.value[:1] in _FIRST
            ):  # fmt: skip
                key_node, _ = self._node(key_event)
                if not isinstance(key_node, ScalarNode):
                    size += self._node(self.loader.get_event())[1]
                    self.problems.add(
                        Code.WRONG_KIND, "a key must be text, not a collection", key_where
                    )
                    continue
                key = key if written else key_node.value
            key = str(key)
            value, value_size = self._node(self.loader.get_event())
            size += value_size
            if not key.isascii():
                key = key.translate(_SHOWN)
            if key == "<<" and written and key_event.implicit[0]:
                self._merge(value, key_where, merged)
            elif key in entries:
                self.problems.add(
                    Code.DUPLICATE_KEY,
                    f"key {key!r} is there twice",
                    key_where,
                    other="first",
                    other_where=entries[key].key_where,
                    fix="remove one of the two",
                )
            else:
                entries[key] = Entry(key, key_where, value)
        # A written key wins over a merged one; merged keys come last, in their own order.
        combined = entries | {k: e for k, e in merged.items() if k not in entries}
        return MapNode(tuple(combined.values()), where), size

    def _merge(self, value: Node, where: Position, merged: dict[str, Entry]) -> None:
        for source in value.items if isinstance(value, ListNode) else (value,):
            if not isinstance(source, MapNode):
                message = "<< merges mappings, given as an alias such as *name"
                self.problems.add(Code.WRONG_KIND, message, where)
                continue
            for entry in source:
                merged.setdefault(entry.key, entry)
