"""Count names that mislead: old names of single things, and classes that use a word in a second meaning.

    python lab/count_words.py              the counts, and the file of every name
    python lab/count_words.py --json       the same for other programs

Six words had three to six meanings each: part, plan, fault, library, call, place. ``WORDS`` gives the one meaning
that each has and the classes that have it; every other class with the word in its name is counted. All Python files
that git tracks are read, tests excepted; nothing is imported.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent


class Word(NamedTuple):
    """The ``meaning`` of a word, its further ``forms``, and the ``classes`` that are named by it."""

    meaning: str
    forms: str
    classes: str


WORDS = {
    "part": Word(
        "the blocks of a graph that run on one machine, and the process that runs them", "parts",
        "BoundPart PartClock PartFeed PartLinks PartOptions PartPhase PartWindow WatchedPart _Part _PartSamples",
    ),
    "plan": Word(
        "a planned jump, or one of a row of jumps", "plans planned",
        "FollowedPlan HopPlan InvalidPlanError JumpPlan PlanAnswer PlanDisplay PlanError PlanFileError PlanJob PlanLibrary PlanLibraryOptions "
        "PlannedJump PlanOutcome PlanProgress PlanRequest PlanRows PlanSamples PlanSegment PlanTest PlanTestResult "
        "ReceivedPlan SpeedPlan SteeredPlan TriggeredJumpPlan",
    ),
    "fault": Word(
        "what is wrong with the hardware or the motion of a robot, or is made to be in its twin", "faults",
        "FaultDetector FaultDetectorConstants FaultDetectorParams FaultDetectorScratch FaultDetectorState FaultReporter "
        "InjectedFault InjectedFaults SafetyFault SwitchFault",
    ),
    "library": Word(
        "the folders in which plans are found; a library of C is a CLibrary or SharedLibrary", "libraries",
        "PlanLibrary PlanLibraryOptions "
        "CLibrary CLibraryBlock CLibraryParameters CLibraryState SharedLibrary RemoteSharedLibrary",
    ),
    "call": Word(
        "an entry of the call table of a tick", "calls",
        "ActiveCalls Call CallSequence ForeignCall KernelCall PythonCall ScheduledCall TickCall TickCalls",
    ),
    "place": Word("assign blocks to machines", "places placed", "PlacedGraph"),
}  # fmt: skip
"""The meaning of each word. Positions are a position, a pose, a location (in a file) or an index."""

MISLEADING = {
    "praise": "", "describe_task": "planner/task/files.py", "printed_problems": "files/problems.py:report",
    "RecordingPlace": "", "take_place": "", "sum_of": "mathematics", "product_of": "mathematics",
    "deep": "planner/task/recipe.py", "demand": "planner/task/recipe.py", "said": "planner/task/recipe.py",
    "curable": "", "eased": "planner", "from_eased": "", "patience": "planner", "quiet": "planner",
    "hat": "blocks", "throw": "blocks", "land_at": "", "land": "blocks", "come_early": "",
    "look_along": "", "cut": "mathematics", "touch": "mathematics",
    "Stretch": "planner", "Span": "", "spans": "planner", "stretches": "planner",
    "Fault": "", "Faults": "", "RobotFault": "", "likeness": "planner",
    "arm_lack": "", "leg_lack": "", "lacking": "planner", "why_not": "",
    "unless_passed": "", "require_valid_once": "", "noted_folder": "", "nowhere": "hal", "WithoutPandas": "",
    "Refused": "mathematics", "Part": "", "Library": "",
    "place_of": "", "part_of": "", "choose_place": "", "mean_place": "", "landing_place": "", "place_bodies": "",
}  # fmt: skip
"""Names that said nothing, or something else, and where: everywhere, or in files that begin so (``FILE:FUNCTION``)."""
MISLEADING_FILES = (
    "planner/library/once.py", "runtime/carried.py", "logs/file/surroundings.py", "logs/recording/place.py",
    "robots/part.py", "robots/validation/faults.py", "runtime/language/fault.py", "hal/twin/faults.py",
)  # fmt: skip


class Name(NamedTuple):
    """A ``name`` that is defined in the file ``path`` at ``line``, within ``function``; a class if ``is_class``."""

    name: str
    path: str
    line: int
    function: str
    is_class: bool


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    files = tracked()
    names = [name for path, text in files.items() for name in defined(path, text)]
    counts = {
        "misleading": [
            *map(where, misleading(names)),
            *(p for p in files if p in MISLEADING_FILES),
        ],
        **{word: [*map(where, second_meanings(word, names))] for word in WORDS},
    }
    if arguments.json:
        print(json.dumps({"total": sum(map(len, counts.values())), "names": counts}, indent=2))
        return
    for kind, found in counts.items():
        meaning = f"  {WORDS[kind].meaning}" if kind in WORDS else ""
        print(f"{len(found):4d}  {kind}{meaning}")
        print("".join(f"        {each}\n" for each in found), end="")
    print(f"{sum(map(len, counts.values())):4d}  ambiguous names")


def where(name: Name) -> str:
    """Return the file and line of a name, and the name."""
    return f"{name.path}:{name.line}: {name.name}"


def tracked() -> Mapping[str, str]:
    """Return the text of all Python files of the checkout but the tests, by path."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "*.py"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    paths = [path for path in listed.stdout.split("\0") if path and "tests/" not in path]
    return {path: (ROOT / path).read_text(encoding="utf-8") for path in sorted(paths)}


def defined(path: str, text: str) -> list[Name]:
    """Find the names of the classes, functions, parameters and variables that a file defines."""
    found = []

    def visit(node: ast.AST, function: str) -> None:
        match node:
            case ast.ClassDef(name=name, lineno=line):
                found.append(Name(name, path, line, function, True))
            case (
                ast.FunctionDef(name=name, lineno=line)
                | ast.AsyncFunctionDef(name=name, lineno=line)
            ):
                found.append(Name(name, path, line, function, False))
                function = name
            case ast.arg(arg=name, lineno=line):
                found.append(Name(name, path, line, function, False))
            case ast.Name(id=name, ctx=ast.Store(), lineno=line):
                found.append(Name(name, path, line, function, False))
        for child in ast.iter_child_nodes(node):
            visit(child, function)

    visit(ast.parse(text), "")
    return found


def misleading(names: list[Name]) -> Iterator[Name]:
    """Yield the names that ``MISLEADING`` lists for their file."""
    for name in names:
        scope = MISLEADING.get(name.name)
        if scope is None:
            continue
        path, _, function = scope.partition(":")
        if name.path.startswith(path) and function in ("", name.function):
            yield name


def second_meanings(word: str, names: list[Name]) -> Iterator[Name]:
    """Yield the classes that have a word in their name and are not of its meaning."""
    known = WORDS[word]
    forms, classes = {word, *known.forms.split()}, set(known.classes.split())
    for name in names:
        if not name.is_class or name.name in classes:
            continue
        words = {each.lower() for each in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name.name)}
        if words & forms:
            yield name


if __name__ == "__main__":
    main()
