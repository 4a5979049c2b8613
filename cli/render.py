"""``aloft render``: pictures and films of recordings, drawn without a screen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..runtime.language.errors import AloftError
from .shared.options import AsJson, expand_option_groups
from .shared.output import console, errors_reported, print_json, progress_bar, say
from .shared.run_panels import run_panels
from .shared.viewing import read

if TYPE_CHECKING:
    from ..studies.film import Camera


@dataclass(frozen=True)
class ViewOptions:
    """The options of the pictures and of the camera."""

    width: Annotated[
        int, typer.Option(min=64, max=3840, help="Width of one run's picture [pixels].")
    ] = 480
    height: Annotated[
        int, typer.Option(min=64, max=2160, help="Height of one run's picture [pixels].")
    ] = 400
    azimuth: Annotated[
        float, typer.Option(help="Direction of view [deg]; 90 is along the world's y axis.")
    ] = 135.0
    elevation: Annotated[
        float, typer.Option(help="Elevation of the view [deg]; negative looks down.")
    ] = -9.0
    distance: Annotated[
        float,
        typer.Option(min=0, help="Distance of the camera [m]; 0: the whole motion is in view."),
    ] = 0.0
    follow: Annotated[bool, typer.Option("--follow", help="The camera follows the robot.")] = False
    no_forces: Annotated[bool, typer.Option("--no-forces", help="Draw no forces.")] = False
    overlay: Annotated[
        bool,
        typer.Option("--overlay", help="Draw several runs into one picture, half transparent."),
    ] = False

    def camera(self) -> Camera:
        """Return the camera that they ask for."""
        from ..studies.film import Camera

        return Camera(
            self.width, self.height, self.azimuth, self.elevation, self.distance, self.follow,
            not self.no_forces, self.overlay,
        )  # fmt: skip


@expand_option_groups
def render(
    recordings: Annotated[
        list[Path], typer.Argument(help="One recording, or several to stand side by side.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="A .gif, .mp4 or .png; by default NAME.gif here."),
    ] = None,
    start: Annotated[float | None, typer.Option("--from", help="The first time [s].")] = None,
    end: Annotated[float | None, typer.Option("--to", help="The last time [s].")] = None,
    at: Annotated[
        float | None, typer.Option(help="For a .png: the time that is shown [s].")
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.001, help="Playback speed; 0.25 is slow motion.")
    ] = 0.5,
    rate: Annotated[float, typer.Option(min=1, max=120, help="Frames per second.")] = 20.0,
    *,
    view: ViewOptions,
    caption: Annotated[
        list[str] | None,
        typer.Option(help="Caption of each run, in order; by default the recording's name."),
    ] = None,
    plots: Annotated[
        list[str] | None,
        typer.Option("--plot", help="Plot this signal beside the runs: a.b.c[2]. Repeatable."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Draw a recording as a film or a picture: the robot, the forces, the phase."""
    from ..studies.film import ENDINGS, Take, instants, pictures, write_film

    with errors_reported(as_json):
        path = output or Path(f"{recordings[0].stem}.{'gif' if at is None else 'png'}")
        if path.suffix not in ENDINGS:
            raise AloftError(
                f"{path} ends with none of {', '.join(ENDINGS)}, which say what to write"
            )
        if (at is not None) != (path.suffix == ".png"):
            raise AloftError(
                "a .png shows the run at one time: give both a .png and --at TIME, or neither"
            )
        names = list(caption or [file.stem for file in recordings])
        if len(names) != len(recordings):
            raise AloftError(f"{len(recordings)} recordings, but {len(names)} captions")
        camera = view.camera()
        runs = [read(file) for file in recordings]
        takes = [Take(run, name, camera) for run, name in zip(runs, names, strict=True)]
        panels = run_panels(runs, names, plots or [], start, end)
        first, last = (start, end) if at is None else (at, at)
        times = instants(takes, first, last, speed / rate)
        out = console()
        with progress_bar(out, "drawing", len(times) * len(takes)) as (progress, task):
            frames = pictures(takes, times, camera, lambda: progress.advance(task), panels)
            try:
                count = write_film(path, frames, rate)
            except OSError as error:
                raise AloftError(f"{path} cannot be written: {error.strerror or error}") from error
    if as_json:
        print_json({"success": True, "file": str(path), "pictures": count})
    else:
        say(
            out,
            f"{count} picture{'s' if count != 1 else ''} in {path}, {path.stat().st_size / 1e6:.1f} MB",
        )
