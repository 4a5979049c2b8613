"""Makes the pictures of the README: ``python docs/make_pictures.py`` from the root.

That of the viewer needs software Vulkan (Debian's mesa-vulkan-drivers), or a graphics card.
"""

from __future__ import annotations

import io
import tempfile
import time
from pathlib import Path

from rich.console import Console

from aloft import LoadError, load
from aloft.cli.output import say
from aloft.cli.run_output import print_result
from aloft.logs.file.reader import read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.whole_view import write_view
from aloft.logs.viewing.viewer import ViewerError, start_viewer
from aloft.runtime.drawing.diagram import diagram
from aloft.runtime.drawing.placing import draw
from aloft.runtime.drawing.svg import svg

FOLDER = Path(__file__).parent
JUMP = FOLDER.parent / "graphs" / "jump.yaml"
THRUST = 0.98
"""An instant [s] late in the thrust, when the forces are large."""
PATIENCE = 300.0
MISTAKES = """rate: 500 Hz
duration: 1 s
robot: bruce
blocks:
  imu:      {use: blocks.Constant, with: {value: [0, 0, 9.81]}}
  contacts: {use: blocks.ContactDetecter, in: {switches: robot.contacts}}
  filter:   {use: blocks.Gain, with: {gian: 0.5}, in: {u: imu.z}}
"""


def console(width: int) -> Console:
    """A console that remembers what is printed and shows nothing."""
    return Console(record=True, width=width, file=io.StringIO(), highlight=False)


def save(out: Console, name: str, title: str) -> None:
    """Write what was printed as a picture."""
    out.save_svg(str(FOLDER / name), title=title)


def save_view(recording: Path, instant: float, path: Path) -> None:
    """What `aloft view` shows of a recording at an instant [s]."""
    from rerun.experimental import ViewerClient

    drawn = write_view(recording.with_name("view.rrd"), read(recording))
    viewer = start_viewer("headless", [drawn], size="1600x900")
    try:
        client = ViewerClient.connect(viewer.source)
        end = time.monotonic() + PATIENCE
        while not (state := client.get_state()).recordings or state.loading or not state.views:
            if time.monotonic() > end:
                raise TimeoutError(f"the recording is not shown after {PATIENCE:g} s")
            time.sleep(0.2)
        client.set_time("t", duration=instant, play_state="paused")
        time.sleep(3.0)  # for what comes into view to be drawn
        client.save_screenshot(str(path.absolute()))
    finally:
        viewer.stop()


def main() -> None:
    """Make all pictures."""
    graph = load(JUMP)
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "jump.rrd"
        result = graph.run(sinks=[Recorder(recording)])
        try:
            save_view(recording, THRUST, FOLDER / "jump.png")
        except (ViewerError, TimeoutError) as error:
            print(f"warning: docs/jump.png is the old one: {error}")
    out = console(90)
    print_result(out, graph.checked.name, result)
    say(out, f"{'success' if result.success else 'no success'}: {result.reason}")
    save(out, "run.svg", "aloft run graphs/jump.yaml")

    drawing = draw(diagram(graph.checked))
    (FOLDER / "graph.svg").write_text(svg(drawing, "the graph of graphs/jump.yaml"))

    wrong = Path("wrong.yaml")
    wrong.write_text(MISTAKES)
    try:
        load(wrong)
    except LoadError as error:
        out = console(100)
        out.print(error.report.rich())
        save(out, "check.svg", "aloft check wrong.yaml")
    finally:
        wrong.unlink()


if __name__ == "__main__":
    main()
