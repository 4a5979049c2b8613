"""A folder with what one machine needs to run its part of a graph, for ``aloft deploy``.

The text of the graph is that of any other part, so that a deployed part and one that runs from the sources
take each other for the same, unless the robot is described by a file. All files that parameters name come along, since every part checks the whole
graph; plans and libraries only where a block of the machine has found them.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, distribution, packages_distributions
from pathlib import Path

from ... import __version__
from ...logs.file.dependencies import files_read, parameter_files
from ...planner.library.library import shipped_folder, user_folder
from ...runtime.bundle import copy_module, is_own_module, with_robot_beside
from ...runtime.graph import load
from ...runtime.language.errors import AloftError
from ...runtime.language.extensions import is_own
from ...runtime.language.stages import CheckedGraph
from ...runtime.links.part import part_graph
from ...runtime.placement.placed import PlacedGraph, moves_actuators, split_over_machines
from ...runtime.running.memory import BoundGraph
from ...runtime.transports.tls import secured

PACKAGE = "aloft-robotics"
ABOUT = "deployment.json"
"""The file by which a folder is known as one of ``aloft deploy``."""
WHEELS, KEYS, CACHE = "wheels", "keys", "cache"


@dataclass(frozen=True)
class Deployment:
    """The files of a deployment that were written.

    Attributes:
        folder: where.
        graph, machine: of whom; the machine is empty for a graph that names none.
        moves_actuators: whether a block of this part moves actuators.
        files: the SHA-256 of each file, by its place in the folder.
        requirements: the packages with their versions, ``name==version``.
    """

    folder: str
    graph: str
    machine: str
    moves_actuators: bool
    files: Mapping[str, str]
    requirements: Sequence[str]


def deploy(
    graph: Path,
    machine: str,
    to: Path,
    overrides: Sequence[str] = (),
    keys: Path | None = None,
    wheels: Path | None = None,
) -> Deployment:
    """Write the folder ``to``, in place of an earlier one.

    Raises:
        LoadError: the graph is wrong.
        RunError: a block of the machine cannot be set up.
        AloftError: there is no such machine, or something is missing: all that is, in one error.
    """
    checked = load(graph, overrides).checked
    part = checked
    problems: list[str] = []
    if machine or checked.machines:
        placed = split_over_machines(checked)
        placed.machine(machine)
        part = part_graph(placed, machine)
        if any(spec.endpoint.startswith("tls/") for spec in checked.machines):
            problems += _missing_keys(placed, machine, keys)
        elif keys is not None:
            problems.append("--keys: no endpoint of the graph is tls/...; leave it out")
    bound = BoundGraph(part)
    moving = any(moves_actuators(s) for s in checked.blocks if s.machine == machine)
    files = _destinations(checked, bound, problems)
    found_wheels = _wheels(wheels, problems)
    if to.exists() and not (to / ABOUT).is_file() and (not to.is_dir() or any(to.iterdir())):
        problems.append(f"{to} is there, and is none of `aloft deploy`; name another folder")
    if problems:
        raise AloftError("\n  ".join((f"{checked.name} cannot be deployed:", *problems)))
    requirements = _requirements(checked)
    to.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{to.name}-", dir=to.parent) as made:
        folder = Path(made) / to.name
        folder.mkdir()
        _write_graph(checked, folder)
        for place_of_it, source in {**files, **found_wheels}.items():
            copy = folder / place_of_it
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)
        if keys is not None:
            shutil.copytree(keys / machine if (keys / machine).is_dir() else keys, folder / KEYS)
        _write_programs(folder, checked.name, machine, moving, keys is not None)
        (folder / "requirements.txt").write_text("".join(f"{r}\n" for r in requirements))
        digests = {
            file.relative_to(folder).as_posix(): sha256(file.read_bytes()).hexdigest()
            for file in sorted(folder.rglob("*"))
            if file.is_file()
        }
        made_of = Deployment(str(to), checked.name, machine, moving, digests, requirements)
        about = {**vars(made_of), "version": __version__}
        del about["folder"]
        (folder / ABOUT).write_text(json.dumps(about, indent=1))
        if to.exists():
            shutil.rmtree(to)
        folder.rename(to)
    return made_of


def _missing_keys(placed: PlacedGraph, machine: str, keys: Path | None) -> list[str]:
    if keys is None:
        return ["--keys: the endpoints are tls/...; name the folder of `aloft keys`"]
    try:
        secured(placed, keys, machine)
    except AloftError as error:
        return [f"--keys: {error}"]
    return []


def _destinations(graph: CheckedGraph, bound: BoundGraph, problems: list[str]) -> dict[str, Path]:
    """Return the destination of each file that does not ship with aloft. What a parameter names
    keeps its name."""
    named = {**parameter_files(graph), **files_read(bound)}
    found: dict[str, Path] = {}
    for entry, file in named.items():
        file = file.absolute()
        if file.is_relative_to(shipped_folder()):
            continue
        block, _, value = entry.partition(": ")
        if file.is_relative_to(user_folder().parent):
            goal = f"{CACHE}/aloft/{file.relative_to(user_folder().parent).as_posix()}"
        elif value:
            goal = value
        else:  # found in the folder that a parameter names
            path, _, name = block.partition("/")
            path, _, parameter = path.rpartition(".")
            goal = f"{dict(graph.block(path).params)[parameter]}/{name}"
        if Path(goal).is_absolute() or ".." in Path(goal).parts:
            problems.append(
                f"{block.partition('/')[0]}: {file} is not below the graph's folder; "
                "put it there, and name it from there on"
            )
        elif goal in found and found[goal].read_bytes() != file.read_bytes():
            problems.append(f"{block}: {file} and {found[goal]} have the same name, {goal}")
        else:
            found[goal] = file
    return found


def _write_graph(graph: CheckedGraph, folder: Path) -> None:
    assert graph.resolved is not None
    text = with_robot_beside(graph.resolved, graph.robot, folder).text
    (folder / f"{graph.name}.yaml").write_text(text, encoding="utf-8")
    for spec in graph.blocks:
        name = getattr(spec, "use", "") or spec.block_type.__module__
        if not is_own(spec.block_type.__module__):
            copy_module(name.partition(":")[0], spec.block_type.__module__, folder)


def _wheels(folder: Path | None, problems: list[str]) -> dict[str, Path]:
    if folder is None:
        return {}
    wheels = sorted(folder.glob("*.whl"))
    if not any(w.name.startswith(f"{PACKAGE.replace('-', '_')}-{__version__}-") for w in wheels):
        problems.append(
            f"--wheels: {folder} has no wheel of {PACKAGE} {__version__}; `make release` makes it"
        )
    return {f"{WHEELS}/{wheel.name}": wheel for wheel in wheels}


def _requirements(graph: CheckedGraph) -> list[str]:
    """Return the requirements of the deployment: aloft, its own, the extras of which something is
    imported, and the distributions that blocks are installed in."""
    imported = {name.partition(".")[0] for name in sys.modules}
    distributions = packages_distributions()
    loaded = {name for module in imported for name in distributions.get(module, ())}
    needs, extras = _needs(PACKAGE)
    wanted = {_plain(name): name for name in extras if _plain(name) in set(map(_plain, loaded))}
    chosen = [*needs, *wanted.values()]
    for spec in graph.blocks:
        module = spec.block_type.__module__
        if not is_own_module(module):
            chosen += distributions.get(module.partition(".")[0], ())
    found: dict[str, str] = {_plain(PACKAGE): f"{PACKAGE}=={__version__}"}
    pending = [name for name in chosen if _plain(name) not in found]
    while pending:
        name = pending.pop()
        if _plain(name) in found:
            continue
        try:
            found[_plain(name)] = f"{_plain(name)}=={distribution(name).version}"
        except PackageNotFoundError:  # not on this system or version of Python
            continue
        pending += _needs(name)[0]
    return sorted(found.values())


def _needs(name: str) -> tuple[list[str], list[str]]:
    """Return the names of the distributions that one always needs, and of those that its extras
    need."""
    always: list[str] = []
    extras: list[str] = []
    for text in distribution(name).requires or ():
        needed = re.match(r"[A-Za-z0-9._-]+", text)
        if needed:
            (extras if "extra ==" in text else always).append(needed[0])
    return always, extras


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _write_programs(folder: Path, graph: str, machine: str, moving: bool, keys: bool) -> None:
    unit = "-".join(filter(None, ("aloft", graph, machine)))
    options = [f"--machine {machine}"] if machine else []
    options += [f"--keys {KEYS}"] if keys else []
    words: dict[str, str] = {
        "what": f"{graph}, machine {machine}" if machine else graph,
        "unit": unit,
        "command": " ".join(["run", f"{graph}.yaml", *options]),
        "python": f"{sys.version_info.major}.{sys.version_info.minor}",
        "restart": BY_HAND if moving else BY_ITSELF,
        "install": "" if moving else "\n[Install]\nWantedBy=multi-user.target\n",
    }
    texts: Iterable[tuple[str, str]] = (
        ("run.sh", RUN), (f"{unit}.service", UNIT), ("Containerfile", CONTAINER),
    )  # fmt: skip
    for name, text in texts:
        (folder / name).write_text(text.format(**words))
    (folder / "run.sh").chmod(0o755)


RUN = """\
#!/bin/sh
# Runs this machine's part: {what}. Before the first time:
#   python{python} -m venv venv && venv/bin/pip install --find-links wheels -r requirements.txt
cd "$(dirname "$0")"
export XDG_CACHE_HOME="$PWD/cache"
PATH="$PWD/venv/bin:$PATH"
exec aloft {command} "$@"
"""

UNIT = """\
# Copy the folder to /opt/{unit}, and this file to /etc/systemd/system.
[Unit]
Description=aloft: {what}
Wants=network-online.target
After=network-online.target

[Service]
WorkingDirectory=/opt/{unit}
ExecStart=/opt/{unit}/run.sh --quiet
# On a stop the run puts its actuators into damping and closes its recording by itself.
KillMode=mixed
TimeoutStopSec=30
LimitRTPRIO=99
LimitMEMLOCK=infinity
{restart}{install}"""

BY_HAND = """\
# This part moves actuators. Whatever ended it, somebody looks at the robot before motors are enabled again:
# nothing restarts it, and it does not start with the machine.
Restart=no
"""

BY_ITSELF = """\
# This part moves no actuators: it may come back after a crash and wait for the others, of which the one with
# the motors does not come back by itself. It does not after a run that ended, or that was wrong (0, 1, 2, 4).
Restart=on-failure
RestartSec=2
RestartPreventExitStatus=0 1 2 4
"""

CONTAINER = """\
# podman build -t {unit} .; podman run --rm --network host --restart no {unit}
FROM docker.io/library/python:{python}-slim
WORKDIR /opt/{unit}
COPY . .
RUN pip install --no-cache-dir --find-links wheels -r requirements.txt
ENTRYPOINT ["sh", "run.sh"]
"""
