"""Weighs the package: the code that a maintainer has to read, and the declarations that repeat others.

    python lab/weigh.py                     the working tree, folder by folder and in total
    python lab/weigh.py --base a4c74fc      beside a git revision
    python lab/weigh.py --json              the same for other programs, with names and places

Tests, docs and scripts are left out. Everything is read from the syntax trees of the tracked files;
nothing is imported. ``MEASURES`` says what each column counts.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import subprocess
import sys
import tarfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LEFT_OUT = ("tests/", "docs/", "scripts/")
BESIDE = ("extensions", "lab")
"""The folders beside the core: their rows are below the total, which is the core's, and "all" is the sum."""
SHORT = 60
"""A file with fewer lines is short."""
WIDEST = 8
"""Number of the functions with the most arguments that are listed."""

MEASURES = {
    "files": "Python files",
    "lines": "lines, blank ones and comments included",
    "short": f"files shorter than {SHORT} lines",
    "imported once": "files that exactly one other file of the package imports",
    "named tuples": "classes derived from NamedTuple",
    "restating": "named tuples that repeat the fields of a Signal or of parameters",
    "float()": "calls of float in functions decorated with @kernel",
    "vague classes": "classes whose whole name is a word of VAGUE",
    "shared names": "names of classes that stand for more than one thing in the package",
    "shared tuples": "names that more than one named tuple has",
}

# Participles, pronouns and everyday words: none says what an object of the class is.
VAGUE = {
    "Aim", "Asked", "Bent", "Brought", "Built", "Changed", "Chosen", "Drawn", "Due",
    "Elsewhere", "Ends", "Fed", "Filler", "Flown", "Found", "Given", "Goes", "Hears", "Held",
    "Joined", "Keeps", "Kept", "Known", "Left", "Lifted", "Look", "Looks", "Made", "Meant",
    "Measured", "Met", "Moved", "Named", "Now", "Others", "Planned", "Present", "Read", "Said",
    "Says", "Scales", "Seen", "Sent", "Shown", "Shows", "Showing", "Split", "Stood", "Stored",
    "Taken", "Takes", "Thing", "Told", "Took", "Turn", "Turns", "Used", "Wanted", "Way", "Ways",
    "Whole", "Wish", "Wishes", "Word", "Words", "Works", "Written",
}  # fmt: skip


@dataclass
class Weight:
    """The counts of one folder by measure; in total also the names and places behind them."""

    counts: Counter[str] = field(default_factory=Counter)
    places: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def add(self, measure: str, place: str, number: int = 1) -> None:
        self.counts[measure] += number
        self.places[measure].append(place)


@dataclass
class Source:
    """One file of the package: its path, its text and its syntax tree."""

    path: str
    text: str
    tree: ast.Module

    @property
    def folder(self) -> str:
        return self.path.split("/")[0] if "/" in self.path else "."

    def classes(self) -> list[ast.ClassDef]:
        """Return classes of the module itself, not those inside of others."""
        return [node for node in self.tree.body if isinstance(node, ast.ClassDef)]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--base", metavar="REV", help="a git revision to compare with")
    parser.add_argument("--json", action="store_true", help="print JSON, with names and places")
    arguments = parser.parse_args()
    now = weigh(working_tree())
    base = weigh(revision(arguments.base)) if arguments.base else None
    if arguments.json:
        report = {"now": as_data(now)} | ({"base": as_data(base)} if base else {})
        json.dump(report, sys.stdout, indent=1)
        print()
    else:
        print_table(now, base)


def working_tree() -> list[Source]:
    """Return the tracked files as they are now, and new ones that git does not ignore."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.py"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return parse(
        {name: (ROOT / name).read_text("utf-8") for name in names.split() if (ROOT / name).exists()}
    )


def revision(name: str) -> list[Source]:
    """Return the files of a git revision."""
    archive = subprocess.run(
        ["git", "archive", "--format=tar", name], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        texts = {
            member.name: content.read().decode("utf-8")
            for member in tar
            if member.name.endswith(".py") and (content := tar.extractfile(member)) is not None
        }
    return parse(texts)


def parse(texts: dict[str, str]) -> list[Source]:
    return [
        Source(path, text, ast.parse(text))
        for path, text in sorted(texts.items())
        if not path.startswith(LEFT_OUT)
        and "/tests/" not in path
        and not path.endswith("conftest.py")
    ]


def weigh(sources: list[Source]) -> dict[str, Weight]:
    """Count the weight of each folder of the core, of the core as ``total``, of each extension and the
    lab, and of everything as ``all``."""
    weights = weigh_folders([each for each in sources if each.folder not in BESIDE])
    rooms: dict[str, list[Source]] = defaultdict(list)
    for each in sources:
        if each.folder in BESIDE:
            depth = 2 if each.folder == "extensions" else 1
            rooms["/".join(Path(each.path).parts[:depth])].append(each)
    for room, inside in rooms.items():
        weights[room] = weigh_folders(inside)["total"]
    weights["all"] = weigh_folders(sources)["total"]
    return weights


def weigh_folders(sources: list[Source]) -> dict[str, Weight]:
    """Count the weight of each folder, and of all of them as ``total``."""
    weights: dict[str, Weight] = defaultdict(Weight)
    importers = imported_by(sources)
    declared = declared_fields(sources)
    for source in sources:
        for weight in (weights[source.folder], weights["total"]):
            lines = len(source.text.splitlines())
            weight.add("files", source.path)
            weight.add("lines", source.path, lines)
            if lines < SHORT:
                weight.add("short", source.path)
            if len(importers[source.path]) == 1:
                weight.add("imported once", source.path)
            for node in source.classes():
                place = f"{source.path}:{node.lineno} {node.name}"
                if is_named_tuple(node):
                    weight.add("named tuples", place)
                    if restates(node, declared):
                        weight.add("restating", place)
                if node.name in VAGUE:
                    weight.add("vague classes", place)
            for kernel in kernels(source.tree):
                if number := calls_of_float(kernel):
                    weight.add("float()", f"{source.path}:{kernel.lineno} {kernel.name}", number)
    count_shared_names(sources, weights)
    for source in sources:
        for place, number in widths(source):
            weights["total"].add("arguments", place, 0)
            weights["total"].counts[f"arguments of {place}"] = number
    return weights


def imported_by(sources: list[Source]) -> dict[str, set[str]]:
    """Return for each file the other files of the package that import it."""
    modules = {module_of(source.path): source.path for source in sources}
    importers: dict[str, set[str]] = {source.path: set() for source in sources}
    for source in sources:
        package = tuple(source.path.split("/")[:-1])
        for node in ast.walk(source.tree):
            if not isinstance(node, ast.ImportFrom) or not node.level:
                continue
            start = package[: len(package) - node.level + 1]
            module = (*start, *(node.module.split(".") if node.module else ()))
            for alias in node.names:
                target = modules.get((*module, alias.name)) or modules.get(module)
                if target and target != source.path:
                    importers[target].add(source.path)
    return importers


def module_of(path: str) -> tuple[str, ...]:
    parts = tuple(path.removesuffix(".py").split("/"))
    return parts[:-1] if parts[-1] == "__init__" else parts


def declared_fields(sources: list[Source]) -> list[set[str]]:
    """Return the names of the fields of each Signal and each class of parameters in the package.

    A class counts as one of them when a base, over any number of classes of the package, is called
    Signal, Parameters or BaseModel.
    """
    classes = [
        node
        for source in sources
        for node in ast.walk(source.tree)
        if isinstance(node, ast.ClassDef)
    ]
    names = {"Signal", "Parameters", "BaseModel"}
    while more := {n.name for n in classes if names.intersection(bases(n))} - names:
        names |= more
    fields: dict[str, set[str]] = defaultdict(set)
    for node in classes:
        if node.name in names:
            fields[node.name] |= own_fields(node)
    for _ in range(3):  # what is inherited from classes of the package, which derive a few times
        for node in classes:
            for base in bases(node):
                if node.name in fields and base in fields:
                    fields[node.name] |= fields[base]
    return [each for each in fields.values() if each]


def bases(node: ast.ClassDef) -> list[str]:
    return [ast.unparse(base).split("[")[0].split(".")[-1] for base in node.bases]


def own_fields(node: ast.ClassDef) -> set[str]:
    """Return the names that a class body declares: ``name: type`` and ``name = field(...)``."""
    found = set()
    for statement in node.body:
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            found.add(statement.target.id)
        elif isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Call):
            found |= {each.id for each in statement.targets if isinstance(each, ast.Name)}
    return found


def is_named_tuple(node: ast.ClassDef) -> bool:
    return "NamedTuple" in bases(node)


def restates(node: ast.ClassDef, declared: list[set[str]]) -> bool:
    """Tell whether a named tuple says so in its docstring, or has only fields that one declaration
    has."""
    if "The fields of" in (ast.get_docstring(node) or ""):
        return True
    names = own_fields(node)
    return len(names) > 1 and any(names <= each for each in declared)


def kernels(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Yield the functions that are decorated with ``@kernel``, with or without arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            names = [ast.unparse(each).split("(")[0] for each in node.decorator_list]
            if any(name.split(".")[-1] == "kernel" for name in names):
                yield node


def calls_of_float(node: ast.AST) -> int:
    return sum(
        isinstance(each, ast.Call) and isinstance(each.func, ast.Name) and each.func.id == "float"
        for each in ast.walk(node)
    )


def count_shared_names(sources: list[Source], weights: dict[str, Weight]) -> None:
    """Count names of classes that are defined in more than one file; a folder counts those it
    defines."""
    for measure, counted in (("shared names", None), ("shared tuples", is_named_tuple)):
        places: dict[str, list[tuple[str, str]]] = defaultdict(list)
        for source in sources:
            for node in filter(counted, source.classes()):
                places[node.name].append((source.folder, f"{source.path}:{node.lineno}"))
        for name, found in sorted(places.items()):
            if len(found) > 1:
                for folder in {folder for folder, _ in found} | {"total"}:
                    weights[folder].add(measure, f"{name}: {', '.join(p for _, p in found)}")


def widths(source: Source) -> Iterator[tuple[str, int]]:
    """Yield the functions of a file with the number of their arguments, without self and cls."""
    for node in ast.walk(source.tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            number = sum(each.arg not in ("self", "cls") for each in every)
            yield f"{source.path}:{node.lineno} {node.name}", number


def widest(weights: dict[str, Weight]) -> list[tuple[int, str]]:
    total = weights["total"]
    found = [(total.counts[f"arguments of {each}"], each) for each in total.places["arguments"]]
    return sorted(found, key=lambda each: (-each[0], each[1]))[:WIDEST]


def as_data(weights: dict[str, Weight]) -> dict[str, object]:
    """Return the weights as plain data: numbers for each folder; for the total also the names
    behind them."""
    folders = {
        name: {measure: weight.counts[measure] for measure in MEASURES}
        for name, weight in sorted(weights.items())
    }
    behind = {
        measure: weights["total"].places[measure]
        for measure in MEASURES
        if measure not in ("files", "lines")
    }
    wide = [{"arguments": number, "function": place} for number, place in widest(weights)]
    return {"folders": folders, "places": behind, "widest": wide}


def print_table(now: dict[str, Weight], base: dict[str, Weight] | None) -> None:
    """Print a row for each folder; with a base a second one with the numbers of the revision."""
    folders = {*now, *(base or {})}
    beside = sorted(name for name in folders if name.startswith(BESIDE))
    names = [*sorted(folders - {"total", "all", *beside}), "total", *beside, "all"]
    print(" " * 26 + "".join(f"{measure:>15}" for measure in MEASURES))
    for name in names:
        print(row(name, now.get(name)))
        if base is not None:
            print(row("  base", base.get(name)))
    for title, weights in (("widest functions", now), ("  base", base)):
        if weights is not None:
            print(f"\n{title}: " + ", ".join(str(number) for number, _ in widest(weights)))
            for number, place in widest(weights):
                print(f"  {number:>3} {place}")


def row(name: str, weight: Weight | None) -> str:
    counts = weight.counts if weight is not None else Counter()
    return f"{name:<26}" + "".join(f"{counts[measure]:>15,}" for measure in MEASURES)


if __name__ == "__main__":
    main()
