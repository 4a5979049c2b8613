"""Keeps what studies found as data files with the commit of the code that ran, makes pages' tables of them, and says
which are stale.

::

    python lab/pages/study_data.py keep [--commit C] RESULTS ...   a data file and tables from folders of `aloft study`
    python lab/pages/study_data.py probe [STUDY ...]               run a few of a data file's runs again; exit 1 if any differ
    python lab/pages/study_data.py stale                           what has changed since, by data file; exit 1 if any
    python lab/pages/study_data.py mark                            write that below the tables

A data file is ``STUDY.json`` in ``docs/data``. Its table stands in the pages of ``PAGES`` between ``<!-- data: STUDY -->`` and
``<!-- end of data: STUDY -->``, and a test holds the two together. A table is stale if the files in ``measures`` of its data
file have changed since its commit.

Most changes of a file change no run. So a data file has ``probes``: runs with their hashes, every value of every axis in one of them
at least. Where all give the same hash with the present code, ``same_at`` is its commit, and a table is stale from there.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import Any

from result_tables import growth_table

ROOT = Path(__file__).parents[2]
DATA = "docs/data"
PAGES: Mapping[str, tuple[str, ...]] = {
    "estimator": ("docs/comparisons.md",),
    "formulations": ("docs/comparisons.md",),
    "paper_controller": ("docs/comparisons.md",),
    "paper_limits": ("docs/comparisons.md",),
    "paper_factors": ("docs/comparisons.md",),
    "paper_plans": ("docs/comparisons.md",),
    "paper_pushes": ("docs/landing.md",),
    "push_polar": ("docs/landing.md",),
    "push_polar_12cm": ("docs/landing.md",),
    "push_strongest": ("docs/landing.md",),
    "somersaults": ("docs/planning.md",),
}
REFRESHED = ("estimator",)
"""Their tables are made by ``refresh.py``."""
CONTROLLER = (
    "blocks",
    "mathematics",
    "graphs/controllers",
    "graphs/trials",
    "graphs/jump.yaml",
    "hal/simulated",
    "robots/bruce",
)
"""What the outcome of a jump depends on."""
SAME = ":(exclude)mathematics/compiling"
"""How kernels are compiled: tests hold their results to those of Python, to the last bit."""
MORE: Mapping[str, tuple[str, ...]] = {"paper_plans": ("planner",), "formulations": ("planner",)}
"""What the outcome of a study depends on beside that."""
MEDIANS: Mapping[str, Mapping[str, tuple[str, float]]] = {
    "paper_controller": {
        "apex [cm]": ("apex_above_standing_m", 100.0),
        "ahead [cm]": ("jump_distance_x_m", 100.0),
        "turned [deg]": ("jump_yaw_deg", 1.0),
        "k_y at lift-off [mN m s]": ("lift_off_pitch_momentum_nms", 1000.0),
    },
    "paper_limits": {
        "ahead [cm]": ("jump_distance_x_m", 100.0),
        "turned [deg]": ("jump_yaw_deg", 1.0),
    },
}
"""Columns of a study's table beside the counts: a metric, and its factor. The median is over the runs that stand."""
STANDS_TILT = 5.0
"""deg, at rest; the paper's criterion in words is that the robot lands stably."""
HEADS = {"impulse_n_s": "impulse [N s]"}
"""Heads of a table's columns that are not their labels."""
AXES = {"impulse_n_s": "impulse={:g} N s"}
"""What ``--where`` takes for a label that has a unit."""
OUTCOMES = ("n", "successes", "stands")


def rows_of(
    folder: Path,
    labels: Sequence[str],
    medians: Mapping[str, tuple[str, float]] = MappingProxyType({}),
) -> list[dict[str, Any]]:
    """Return the cells of a study's results, each with its values of ``labels``, counts of its runs, and ``medians`` of
    those that stand.

    A run *stands* if it did not fall and its torso is at most 5 degrees from upright at the end; a run that was ended
    by a fall has no final tilt.
    """
    from pyarrow import parquet

    runs = parquet.read_table(folder / "runs.parquet").to_pylist()
    found: dict[tuple[Any, ...], dict[str, Any]] = {}
    standing: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for run in runs:
        key = tuple(run[label] for label in labels)
        row = found.setdefault(
            key, {**dict(zip(labels, key, strict=True)), **dict.fromkeys(OUTCOMES, 0), "misses": {}}
        )
        tilt = run.get("final_tilt_deg")
        stands = tilt is not None and tilt < STANDS_TILT
        row["n"] += 1
        row["successes"] += bool(run["success"])
        row["stands"] += stands
        if stands:
            standing.setdefault(key, []).append(run)
        if not run["success"]:
            miss = kind_of_miss(run["reason"])
            row["misses"][miss] = row["misses"].get(miss, 0) + 1
    for key, row in found.items():
        for name, (metric, factor) in medians.items():
            values = [
                factor * run[metric] for run in standing.get(key, []) if run[metric] is not None
            ]
            row[name] = round(median(values), 1) + 0.0 if values else None
    return list(found.values())


def probes_of(folder: Path, labels: Sequence[str]) -> list[dict[str, Any]]:
    """Return a few runs of a study's results with their hashes, such that they have every value of every label."""
    from pyarrow import parquet

    runs = parquet.read_table(folder / "runs.parquet").to_pylist()
    missing = {(label, run[label]) for run in runs for label in labels}
    found = list[dict[str, Any]]()
    while missing or not found:
        best = max(runs, key=lambda run: sum((label, run[label]) in missing for label in labels))
        where = {label: best[label] for label in labels}
        missing -= set(where.items())
        found.append({"where": where, "seed": best["seed"], "run_hash": best["run_hash"]})
    return found


def run_again(study: Path, probe: Mapping[str, Any]) -> list[str]:
    """Return the hashes of a probe's runs with the present code: of more than one where the labels leave out an axis."""
    from pyarrow import parquet

    pairs = (AXES.get(label, f"{label}={{}}").format(at) for label, at in probe["where"].items())
    chosen = [text for pair in pairs for text in ("--where", pair)]
    seeds = f"{probe['seed']}:{probe['seed'] + 1}"
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            ["aloft", "study", study, "--seeds", seeds, *chosen, "--workers", "1", "--out", folder],
            capture_output=True,
            check=False,
        )
        table = Path(folder) / "runs.parquet"
        if not table.is_file():
            return []
        return [str(run["run_hash"]) for run in parquet.read_table(table).to_pylist()]


def probe(
    root: Path,
    names: Sequence[str],
    commit: str,
    hashes: Callable[[Path, Mapping[str, Any]], Sequence[str]] = run_again,
) -> list[str]:
    """Run the probes of data files again, all where none is named, and write ``same_at`` in those where none differs.

    Returns: a line for every probe that differs.
    """
    differ = list[str]()
    for name, data in data_files(root):
        if (names and name not in names) or "probes" not in data:
            continue
        changed = [
            f"{name}: {each['where']}, seed {each['seed']}, runs otherwise"
            for each in data["probes"]
            if each["run_hash"] not in hashes(root / data["study"], each)
        ]
        if not changed:
            write(root, name, {**data, "same_at": commit})
        differ += changed
    return differ


def labels_of(folder: Path) -> list[str]:
    """Return the names of a study's axes that have more than one value."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    rows = summary["rows"]
    known = ("task", "jump", "arm", "trial", "feet", "steps", "impulse_n_s")
    return [name for name in known if name in rows[0] and len({str(row[name]) for row in rows}) > 1]


def kind_of_miss(reason: str) -> str:
    """Return why a run is no success, in a word or two."""
    kinds = {
        "safety": "safety stop", "fell": "fell", "flight of": "flight too short", "rose": "rise", "jumped": "place", "turned": "turn",
        "tilt": "tilt", "torso": "tilt", "joint": "joint limit", "slid": "feet slid", "moved": "feet slid",
        "stepped": "stepped", "touched": "touched",
    }  # fmt: skip
    return next((kind for text, kind in kinds.items() if text in reason), "other")


def table_of(data: Mapping[str, Any]) -> str:
    """Return the Markdown table of a data file."""
    labels, medians = data["labels"], data.get("medians", [])
    head = [
        *(HEADS.get(label, label) for label in labels),
        *medians,
        "stands",
        "succeeds",
        "misses",
    ]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for row in data["rows"]:
        misses = sorted(row["misses"].items(), key=lambda item: (-item[1], item[0]))
        told = ", ".join(f"{count} {kind}" for kind, count in misses) or "-"
        cells = [str(row[label]) for label in labels]
        cells += ["-" if row[name] is None else f"{row[name]:g}" for name in medians]
        shown = " | ".join(cells)
        counts = f"{row['stands']} of {row['n']} | {row['successes']} of {row['n']}"
        lines.append(f"| {shown} | {counts} | {told} |")
    return "\n".join([*lines, "", made_line(data)]) + "\n"


def made_line(data: Mapping[str, Any]) -> str:
    """Return how the runs of a data file were made."""
    seeds = data["seeds"]
    alike = len({row["n"] for row in data.get("rows", [])}) <= 1
    each = "" if alike else " (a row has as many as it has runs, from the first)"
    which = f"Seeds {seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else f"Seed {seeds[0]}"
    made = f"{which}{each}, code of commit {data['commit'][:8]}."
    if "same_at" in data and data["same_at"] != data["commit"]:
        count = len(data["probes"])
        made += f" With the code of commit {data['same_at'][:8]} the {count} of them that were run again are the same to the last bit."
    return made


def inside_of(data: Mapping[str, Any]) -> str:
    """Return what stands between the marks of a data file that is not stale."""
    if "machine" in data:
        return growth_table(data)
    return table_of(data) if "rows" in data else made_line(data) + "\n" if "seeds" in data else ""


def replaced(text: str, mark: str, inside: str) -> str:
    """Return a page's text with ``inside`` between the marks of a data file.

    Raises:
        ValueError: the page does not have both marks.
    """
    begin, end = f"<!-- data: {mark} -->\n", f"<!-- end of data: {mark} -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"there is no {begin.strip()} with an {end} behind it")
    return before + begin + inside + end + after


def between(text: str, mark: str) -> str:
    """Return what stands between the marks of a data file; empty where they are not."""
    return text.partition(f"<!-- data: {mark} -->\n")[2].partition(f"<!-- end of data: {mark} -->")[
        0
    ]


def git(root: Path, *arguments: str) -> str:
    """Return what a git command prints; empty if it fails, as where the history is not there."""
    done = subprocess.run(
        ["git", *arguments], cwd=root, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() if done.returncode == 0 else ""


def changed_since(root: Path, commit: str, measures: Sequence[str]) -> list[str]:
    """Return the files below ``measures`` that differ between a commit and the files as they are, tests excepted."""
    names = git(root, "diff", "--name-only", commit, "--", *measures, SAME).splitlines()
    found = [
        name for name in names if name.endswith((".py", ".yaml", ".xml")) and "/tests/" not in name
    ]
    return sorted(found, key=lambda name: not (root / name).is_file())  # a page cites what is there


def data_files(root: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and content of every data file."""
    for path in sorted((root / DATA).glob("*.json")):
        yield path.stem, json.loads(path.read_text(encoding="utf-8"))


def stale(root: Path) -> dict[str, list[str]]:
    """Return the files that have changed since, by data file; those with none are left out."""
    found = {
        name: changed_since(root, since(data), data["measures"]) for name, data in data_files(root)
    }
    return {name: changed for name, changed in found.items() if changed}


def since(data: Mapping[str, Any]) -> str:
    """Return the commit whose code makes the runs of a data file, as far as is known."""
    return str(data.get("same_at", data["commit"]))


def stale_line(commit: str, changed: Sequence[str]) -> str:
    """Return the line below a table that is stale."""
    shown = ", ".join(f"`{name}`" for name in changed[:3])
    more = f" and {len(changed) - 3} more" if len(changed) > 3 else ""
    return (
        f"*Stale: since commit {commit[:8]}, whose code made these runs, {shown}{more} changed.*\n"
    )


def write_tables(root: Path) -> None:
    """Write the tables of all data files into their pages, with a line below those that are stale."""
    behind = stale(root)
    for name, data in data_files(root):
        inside = inside_of(data)
        if name in behind:
            inside += "\n" + stale_line(since(data), behind[name])
        for page in data["pages"]:
            path = root / page
            text = replaced(path.read_text(encoding="utf-8"), name, inside)
            path.write_text(text, encoding="utf-8")


def keep(root: Path, folders: Sequence[Path], commit: str) -> Path:
    """Write the data file of a study's results. Of several folders the first has all cells, and later ones replace those
    that they made with more seeds.

    Raises:
        ValueError: the folders are of different studies.
    """
    summaries = [
        json.loads((folder / "summary.json").read_text(encoding="utf-8")) for folder in folders
    ]
    name = summaries[0]["study"]
    if others := sorted({summary["study"] for summary in summaries} - {name}):
        raise ValueError(f"folders of one study at a time: these are of {name} and of {others[0]}")
    labels, medians = labels_of(folders[0]), MEDIANS.get(name, {})
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for folder in folders:
        for row in rows_of(folder, labels, medians):
            key = tuple(row[label] for label in labels)
            if key not in rows or row["n"] > rows[key]["n"]:
                rows[key] = row
    data = {
        "study": f"graphs/studies/{name}.yaml",
        "commit": commit,
        "measures": [*CONTROLLER, *MORE.get(name, ()), f"graphs/studies/{name}.yaml"],
        "pages": list(PAGES[name]),
        "seeds": max((summary["seeds"] for summary in summaries), key=len),
        "labels": labels,
        "medians": list(medians),
        "rows": list(rows.values()),
        "probes": probes_of(folders[0], labels),
    }
    path = root / DATA / f"{name}.json"
    before = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if all(before.get(key) == data[key] for key in ("commit", "probes")) and "same_at" in before:
        data["same_at"] = before["same_at"]
    if name in REFRESHED:
        del data["rows"], data["medians"]
    return write(root, name, data)


def write(root: Path, name: str, data: Mapping[str, Any]) -> Path:
    """Write a data file."""
    path = root / DATA / f"{name}.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


def main(arguments: Sequence[str]) -> int:
    """Run the command line."""
    verb, *rest = arguments or ("",)
    if verb == "keep":
        commit, folders = (rest[1], rest[2:]) if rest[:1] == ["--commit"] else ("HEAD", rest)
        print(keep(ROOT, [Path(each) for each in folders], git(ROOT, "rev-parse", commit)))
    elif verb == "probe":
        differ = probe(ROOT, rest, git(ROOT, "rev-parse", "HEAD"))
        print("\n".join(differ))
        write_tables(ROOT)
        return 1 if differ else 0
    elif verb == "stale":
        behind = stale(ROOT)
        for name, changed in behind.items():
            print(f"{name}: {', '.join(changed)}")
        return 1 if behind else 0
    elif verb != "mark":
        print(__doc__)
        return 2
    write_tables(ROOT)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
