"""Makes the pictures of the README: ``python lab/pages/make_pictures.py`` from the root.

That of the viewer needs software Vulkan (Debian's mesa-vulkan-drivers), or a graphics card; that of
the page of a running graph needs Chromium. ``python lab/pages/make_pictures.py live`` makes those alone, ``gallery``
those of docs/gallery.md, ``pages`` those of other pages.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from aloft import LoadError, load
from aloft.cli.shared.running_graphs import path_of
from aloft.extensions.studio.diagram.diagram import diagram
from aloft.extensions.studio.diagram.layout import draw
from aloft.extensions.studio.diagram.render import svg
from aloft.extensions.studio.live.live_run import LiveRun
from aloft.extensions.studio.live.live_server import LiveServer
from aloft.logs.file.reader import read
from aloft.logs.recording.drawn_run import write_view
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.viewer import ViewerError, start_viewer
from aloft.runtime.live.parameter_endpoint import EndpointError
from aloft.studies.film import Camera, Take, instants, pictures, write_film

FOLDER = Path(__file__).parents[2] / "docs"
JUMP = FOLDER.parent / "graphs" / "jump.yaml"
HOPS = FOLDER.parent / "graphs" / "hops.yaml"
FILMED = {
    "BRUCE, 12 cm": ("graphs/jump.yaml", []),
    "a push in flight": ("graphs/push_12cm.yaml", []),
    "a somersault": ("graphs/somersault.yaml", []),
    "Go2": ("graphs/robots/go2_forward.yaml", []),
}
"""The runs of the film: caption, graph and settings."""
GALLERY = (
    ("mass", "gallery/mass.yaml", "plot", "RECORDING", "place.y", "pid.u"),
    ("cart_pole", "projects/cart_pole/balance.yaml", "render", "RECORDING", "--at", "4.3", "--distance", "3.5"),
    ("swing_up", "projects/cart_pole/swing_up.yaml", "plot", "RECORDING", "robot.joints.position"),
    ("arm", "projects/arm/reach.yaml", "render", "RECORDING", "--at", "1.5"),
    ("quadrotor", "projects/quadrotor/flight.yaml", "plot", "RECORDING", "robot.truth.base_position[2]",
     "robot.truth.base_angular_velocity[0]", "robot.thrusters.thrust"),
    ("hop", "gallery/hop.yaml", "plot", "RECORDING", "robot.joints.position", "phase.state.index"),
    ("ball", "gallery/ball.yaml", "plot", "RECORDING", "ball_height.y", "ball_place.y", "cup_place.y"),
    ("mass_two", "gallery/mass_two.yaml", "graph", "GRAPH"),
    ("push", "gallery/push.yaml", "graph", "GRAPH"),
    ("ros2", "gallery/ros2.yaml", "graph", "GRAPH"),
    ("fmu", "gallery/fmu.yaml", "graph", "GRAPH"),
    ("urdf", "projects/arm/urdf.yaml", "render", "RECORDING", "--at", "3", "--distance", "2.2"),
    ("jump", "../graphs/jump.yaml", "render", "RECORDING", "--at", "1.1"),
)  # fmt: skip
"""Pictures of the gallery: name, graph, and the verb that draws it with what it is given."""
PAGES = (
    ("gantry", "../graphs/from_gantry.yaml", "render", "RECORDING", "--at", "0.6", "--width", "640",
     "--caption", "in the gantry"),
    ("robots", "../graphs/robots/go2_jump.yaml ../graphs/robots/g1_jump.yaml ../graphs/robots/solo12_jump.yaml",
     "render", "RECORDING", "--at", "1.1", "--width", "320", "--caption", "Go2", "--caption", "G1", "--caption",
     "Solo12"),
    ("uneven", "../graphs/forward_20cm.yaml ../graphs/trials/uneven.yaml", "render", "RECORDING", "--at", "1.45",
     "--width", "640", "--elevation", "-20", "--caption", "ahead 20 cm, uneven"),
    ("stones", "../extensions/hopping/graphs/steer_stones.yaml", "render", "RECORDING", "--at", "9", "--width", "640", "--elevation", "-25",
     "--distance", "2.2", "--caption", "from stone to stone"),
    ("other_robots",
     ("../graphs/robots/anymal_c_stand.yaml ../graphs/robots/hyq_stand.yaml "
      "../graphs/robots/talos_stand.yaml"),
     "render", "RECORDING", "--at", "1", "--width", "320", "--caption", "ANYmal C", "--caption", "HyQ", "--caption",
     "Talos"),
    ("machines", "../graphs/machines/jump_two.yaml", "graph", "GRAPH"),
)  # fmt: skip
"""The same for other pages; of several graphs, which stand side by side, and trials, which change them."""
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
    """Return a console that remembers what is printed and shows nothing."""
    return Console(record=True, width=width, file=io.StringIO(), highlight=False)


def save(out: Console, name: str, title: str) -> None:
    """Write what was printed as a picture."""
    out.save_svg(str(FOLDER / name), title=title)


def save_view(recording: Path, instant: float, path: Path) -> None:
    """Draw the view that `aloft view` gives of a recording at an instant [s]."""
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


def save_film(path: Path) -> None:
    """Run the graphs of ``FILMED`` and draw them side by side, in slow motion."""
    camera = Camera(width=260, height=300)
    takes = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (caption, (graph, settings)) in enumerate(FILMED.items()):
            recording = Path(folder) / f"{number}.rrd"
            load(FOLDER.parent / graph, settings).run(sinks=[Recorder(recording)])
            takes.append(Take(read(recording), caption, camera))
        times = instants(takes, 0.5, 2.3, 0.5 / 20.0)
        write_film(path, pictures(takes, times, camera), 20.0)


def save_drawn(drawn: Sequence[Sequence[str]], folder: Path) -> None:
    """Draw the pictures of a table such as ``GALLERY``, each by the program: the one to run, then
    the one that shows its result."""
    with tempfile.TemporaryDirectory() as made:
        for name, graphs, *shown in drawn:
            files = [str(FOLDER / graph) for graph in graphs.split()]
            trials = [file for file in files if "trials" in file]
            recordings = []
            for file in files if "RECORDING" in shown else ():
                if file not in trials:
                    recordings.append(str(Path(made) / f"{name}_{Path(file).stem}.rrd"))
                    text = f"include: [{', '.join([file, *trials])}]\n"
                    load(text).run(sinks=[Recorder(recordings[-1])])
            words = [text for word in shown for text in
                     {"GRAPH": files, "RECORDING": recordings}.get(word, [word])]  # fmt: skip
            suffix = {"render": ("-o", "png")}.get(shown[0], ("--svg", "svg"))
            target = folder / f"{name}.{suffix[1]}"
            command = [sys.executable, "-m", "aloft", *words, suffix[0], str(target)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    """Make all pictures."""
    save_drawn(GALLERY, FOLDER / "gallery")
    save_drawn(PAGES, FOLDER)
    save_film(FOLDER / "jumps.gif")
    graph = load(JUMP)
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "jump.rrd"
        graph.run(sinks=[Recorder(recording)])
        try:
            save_view(recording, THRUST, FOLDER / "jump.png")
        except (ViewerError, TimeoutError) as error:
            print(f"warning: docs/jump.png is the old one: {error}")
    drawing = draw(diagram(graph.checked))
    (FOLDER / "graph.svg").write_text(svg(drawing, "the graph of graphs/jump.yaml"))

    save_live_page(FOLDER / "live.png")
    save_live_page(FOLDER / "live_paused.png", paused_at=600)
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


def save_live_page(picture: Path, paused_at: int | None = None) -> None:
    """Photograph the page of a graph while it runs, with its parameters, or while it is paused
    before the tick ``paused_at``, from which it has gone back a little."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        print(f"warning: {picture} is the old one: there is no Chromium")
        return
    name = "live-picture"
    # at the pace of the clock, so that it still runs when the page is there
    words = ["run", str(HOPS), "--no-record", "--params", name]
    words += ["--set", "clock.kind=paced"] if paused_at is None else ["--paused"]
    command = [sys.executable, "-m", "aloft", *words]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        live = _live(name)
        if paused_at is not None:
            _stand(live)
            live.control("go on", paused_at + 50)
            _stand(live)
            live.control("back", paused_at)
        server = LiveServer(live, Path("hops-tuned.yaml"), "parameters")
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with server, tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
            subprocess.run(
                [program, "--headless=new", "--no-sandbox", f"--user-data-dir={profile}",
                 "--window-size=1600,900", "--virtual-time-budget=4000", "--hide-scrollbars",
                 f"--screenshot={picture}", server.page],
                check=True, capture_output=True, timeout=PATIENCE,
            )  # fmt: skip
            server.shutdown()
    finally:
        run.terminate()
        run.wait()


def _stand(live: LiveRun) -> None:
    """Wait until the run is paused."""
    end = time.monotonic() + PATIENCE
    while live.now()["state"] != "paused" and time.monotonic() < end:
        time.sleep(0.1)


def _live(name: str) -> LiveRun:
    """Return the run of that name, once it has begun."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return LiveRun(path_of(name))
        except EndpointError:
            if time.monotonic() > end:
                raise
            time.sleep(0.5)


if __name__ == "__main__":
    if sys.argv[1:] == ["gallery"]:
        save_drawn(GALLERY, FOLDER / "gallery")
    elif sys.argv[1:] == ["pages"]:
        save_drawn(PAGES, FOLDER)
    elif sys.argv[1:] == ["live"]:
        save_live_page(FOLDER / "live.png")
        save_live_page(FOLDER / "live_paused.png", paused_at=600)
    else:
        main()
