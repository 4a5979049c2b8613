"""``aloft study FILE --open N``: makes one of a study's worst runs again, records and shows it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from ...runtime.language.errors import AloftError, ExitCode
from ..running.run_output import code_with_recording
from ..shared.output import print_error, print_json, print_warning, say
from ..shared.viewing import draw, how_to_view, show
from .study_runs import check_cells

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from ...studies.study import Filter, Study


def open_run(
    found: Study,
    part: Filter,
    seeds: Sequence[int],
    folder: Path,
    number: int,
    screen: Console,
    as_json: bool,
    *,
    show: bool,
) -> ExitCode:
    """Record the run and, if that is wanted, show it.

    Raises:
        AloftError: the study has no finished runs, or none with that number.
    """
    from ...logs.recording.recorder import Recorder
    from ...studies.execution import Run
    from ...studies.expansion import cells as expand
    from ...studies.journal import Journal
    from ...studies.tuning import read_tuned
    from ...studies.worst import chosen_run, file_name, labels_of, run_again, with_outcomes

    chosen = [cell for cell in expand(found, read_tuned(found)) if part.takes(cell.labels)]
    cells = check_cells(found, chosen, screen)
    with Journal(folder / "runs.jsonl") as journal:
        runs = with_outcomes([Run(c, seed) for c in cells for seed in seeds], journal.outcomes)
    if not runs:
        raise AloftError(
            f"no run of {found.path} as it is now is in {folder}; run the study first: "
            f"aloft study {found.path}"
        )
    run = chosen_run(runs, number)
    assert run.outcome is not None
    say(screen, f"run {number} of {len(runs)}: {labels_of(run)}")
    path = folder / "worst" / file_name(run)
    recorder = Recorder(path, on_warning=print_warning)
    result = run_again(run, [recorder])
    if result.run_hash != run.outcome.run_hash:
        print_warning("the run gave other bytes than in the study; something has changed since")
    kept = recorder.recording
    if kept is None:
        raise AloftError(recorder.problem)
    if recorder.problem:
        print_error(recorder.problem)
    say(screen, f"{result.reason}; recording: {kept}; to see it: {how_to_view(kept)}")
    if as_json:
        print_json(
            {"success": True, "reason": result.reason, "run": labels_of(run),
             "run_succeeded": result.success, "run_hash": result.run_hash,
             "same_bytes": result.run_hash == run.outcome.run_hash, "recording": str(kept),
             "recording_problem": recorder.problem or None}
        )  # fmt: skip
    if show:
        show_recording(kept)
    return code_with_recording(ExitCode.SUCCESS, recorder.problem)


def show_recording(path: Path) -> None:
    """Show the recording in a window until that is closed."""
    with TemporaryDirectory() as folder:
        drawn = Path(folder) / path.name
        draw(path, None, drawn)
        show(drawn, web=False)
