"""Runs a graph once, records and shows it, and prints the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ...runtime.language.errors import ExitCode
from ..shared.output import print_error, print_json, print_place, print_warning, say
from .run_output import code_with_recording, print_result, print_verdict

if TYPE_CHECKING:
    from rich.console import Console

    from ...logs.viewing.viewer import Viewer
    from ...runtime.language.stages import CheckedGraph
    from ...runtime.running.real_time import RealTimeOptions
    from ...runtime.running.run_result import RunResult
    from ...runtime.running.sinks import Sink


class Runs(Protocol):
    """What ``run_once`` runs: a graph, or one machine's part of it."""

    @property
    def checked(self) -> CheckedGraph:
        """The graph that runs."""

    def run(
        self,
        *,
        sinks: Sequence[Sink],
        log: bool,
        plain: bool,
        fuse: bool,
        real_time: RealTimeOptions,
    ) -> RunResult:
        """Run it once."""

    def about(self) -> Mapping[str, Any]:
        """What the JSON object says beside the result of the run."""


def run_once(
    graph: Runs,
    record: Path | None,
    out: Console,
    as_json: bool,
    sinks: Sequence[Sink] = (),
    viewer: Viewer | None = None,
    *,
    keep: int = 0,
    split: float = 0.0,
    said: Sequence[str] = (),
    also: Mapping[str, Any] | None = None,
    times: bool = True,
    traceback: bool = False,
    plain: bool = False,
    fuse: bool = True,
    real_time: RealTimeOptions | None = None,
) -> ExitCode:
    """Run the graph, record and show it, and print the result; ``said`` are warnings so far,
    ``also`` is what else the JSON object has, and ``times`` says whether those of blocks are
    printed."""
    from ...logs.recording.recorder import Recorder
    from ...runtime.running.freeze_guard import FreezeGuard
    from ...runtime.running.real_time import NO_REAL_TIME
    from ..shared.progress import TickCounter, compiling_shown, progress_bar
    from ..shared.viewing import how_to_view
    from .last_words import LastWords

    name = graph.checked.name
    recorder = None
    if record is not None or viewer is not None:
        live = viewer.source if viewer is not None else ""
        recorder = Recorder(record, keep=keep, split=split, live=live, on_warning=print_warning)
    with (
        progress_bar(out, f"running {name}", graph.checked.ticks) as (progress, task),
        compiling_shown(progress),
    ):
        counter = TickCounter(progress, task)
        recorders = [recorder] if recorder is not None else []
        last_words = LastWords(name, as_json)
        with FreezeGuard(graph.checked, as_json=as_json) as guard:
            result = graph.run(
                sinks=[*recorders, counter, last_words, *sinks, guard], log=False, plain=plain,
                fuse=fuse, real_time=real_time or NO_REAL_TIME,
            )  # fmt: skip
    recording = recorder.recording if recorder is not None else None
    problem = recorder.problem if recorder is not None and record is not None else ""
    code = code_with_recording(result.exit_code, problem)
    print_result(out, name, result, times=times)
    if recorder is not None and recording is not None:
        missing = f" ({recorder.missing} ticks are not in it)" if recorder.missing else ""
        say(out, f"recording: {recording}{missing}; to see it: {how_to_view(recording)}")
        if recorder.files:
            say(out, f"the recording is in {len(recorder.files)} files: "
                f"{', '.join(file.name for file in recorder.files)}")  # fmt: skip
        if recorder.before:
            say(out, recorder.before)
    for warning in (*result.cautions, *result.stop_problems):
        print_warning(warning)
    if as_json:
        shown = str(recording) if recording else None
        overrides = dict(graph.checked.overrides)
        warnings = [*said, *result.warnings]
        files = [str(file) for file in recorder.files] if recorder is not None else []
        about = {**result.to_json(), "warnings": warnings, "recording": shown, "files": files}
        about |= {"exit_code": int(code), "recording_problem": problem or None}
        print_json(
            {"graph": name, "overrides": overrides, **(also or {}), **about, **graph.about()}
        )
    else:
        print_verdict(result)
        if result.error is not None:
            print_place(result.error, traceback=traceback)
    if problem:
        print_error(problem)
    return code
