"""The page in a browser: the robots there jump as in Python, and the mouse pushes them."""

from __future__ import annotations

import base64
import math
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from tests.logs.viewing.browser import PROGRAM, Browser
from tests.logs.viewing.pixels import pixels_of

import aloft
from aloft.extensions.export.clib.part import NeedsPython

DEMO = Path(__file__).parents[3] / "extensions" / "export" / "demo"
SEEDS = range(1000, 1004)
PUSHES = [(k % len(SEEDS), 0.7, 45.0 * k) for k in range(8)] + [(k, 1.1, 180.0) for k in range(4)]
"""The number of the robot, the impulse [N s] and its direction [deg]: the weak ones nearly always
land, the strong ones never (docs/landing.md)."""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None:
        """Nothing."""


@pytest.fixture(scope="module")
def world(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("extensions/export/demo/world")


@pytest.fixture(scope="module")
def page(
    docs_script: Callable[[str], ModuleType], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Browser, Path]]:
    """The page of one jump, which is there in a browser."""
    if PROGRAM is None or shutil.which("npm") is None or shutil.which("wasm-ld") is None:
        pytest.skip("needs Chromium, npm and wasm-ld")
    folder = tmp_path_factory.mktemp("demo")
    docs_script("extensions/export/demo/build").build(folder, ["push"], SEEDS)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with Browser(tmp_path_factory.mktemp("chromium"), (1280, 800)) as browser:
        browser.open(f"http://127.0.0.1:{server.server_port}/index.html?speed=0.7&impulse=0")
        wait_for(browser, "window.ready === true")
        yield browser, folder
    server.shutdown()


def value(browser: Browser, expression: str) -> Any:
    found = browser.ask(
        "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
    )
    assert "exceptionDetails" not in found, found["exceptionDetails"]
    return found["result"].get("value")


def wait_for(browser: Browser, expression: str, most: float = 120.0) -> None:
    end = time.monotonic() + most
    while not value(browser, expression):
        assert time.monotonic() < end, value(browser, "document.body.innerText")
        time.sleep(0.1)


@pytest.mark.long
def test_robots_in_the_browser_land_where_they_do_in_python(
    page: tuple[Browser, Path], world: ModuleType
) -> None:
    """Noise and MuJoCo's version differ, so single runs may; the score of both is the same code."""
    browser, _ = page
    judge = world.make_world(DEMO / "push.yaml", [], "push").bound
    landed: dict[str, list[bool]] = {"page": [], "python": []}
    for robot, impulse, angle in PUSHES:
        run = value(browser, f"runAlone('push', {robot}, {impulse}, {angle}, 1)")
        memory = judge.memory
        for region, text in ((memory.bus, run["bus"]), (memory.state, run["state"])):
            region.buffer[:] = np.frombuffer(base64.b64decode(text), np.uint8)
        metrics = judge.blocks["score"].metrics()
        landed["page"].append(metrics["success"])
        assert metrics["success"] <= run["verdict"].startswith("it lands"), run["verdict"]
        graph = aloft.load(DEMO / "push.yaml", {
            "robot.seed": SEEDS[robot], "push.force": impulse / 0.01, "push.angle": math.radians(angle),
        })  # fmt: skip
        landed["python"].append(graph.run(log=False).success)
    for runs in landed.values():
        assert sum(runs[:8]) >= 7 and sum(runs[8:]) <= 1, landed


@pytest.mark.long
def test_the_page_is_small_and_a_drag_of_the_mouse_pushes_the_robot(
    page: tuple[Browser, Path],
) -> None:
    browser, folder = page
    whole = sum(file.stat().st_size for file in folder.iterdir())
    assert (
        whole + 2 * sum((folder / f"push.{kind}.z").stat().st_size for kind in ("wasm", "json"))
        < 15e6
    )
    # a tenth of real time until it is pushed: it must be on the ground however slow this machine is
    speed = "document.querySelector('[name=speed]')"
    value(browser, f"{speed}.add(new Option('slow', '0.1')); {speed}.value = '0.1'")
    value(browser, "document.querySelector('button').click()")
    wait_for(browser, "/(stand|squat), 0[.]/.test(document.getElementById('phase').textContent)")
    red, _, blue = np.moveaxis(pixels_of(browser.picture())[:, :800, :3], 2, 0)
    assert (red > blue + 60).sum() > 200 and (blue > red + 60).sum() > 2000  # battery, chest
    x, y = 400, 280  # on the torso
    for kind, dx in (("mousePressed", 0), ("mouseMoved", 60), ("mouseReleased", 60)):
        browser.ask(
            "Input.dispatchMouseEvent", type=kind, x=x + dx, y=y, button="left", buttons=1, clickCount=1
        )  # fmt: skip
    ((px, py, pz),) = value(browser, "window.pushes")
    assert 0.02 < math.hypot(px, py) <= 1.2 and abs(pz) < 1e-9
    value(browser, "document.getElementById('push').click()")
    assert value(browser, "window.pushes[1]") == [0.7, 0.0, 0.0], "the paper's push, ahead"
    assert value(browser, f"{speed}.options[3].text") == "0.7 x real time", "the address's speed"
    value(browser, f"{speed}.value = '1'")
    wait_for(browser, "document.getElementById('verdict').textContent !== ''", 300.0)
    said = value(browser, "document.getElementById('verdict').textContent")
    assert said.startswith("it "), said


@pytest.mark.long
def test_a_block_in_plain_python_is_refused(world: ModuleType, tmp_path: Path) -> None:
    graph = tmp_path / "noisy.yaml"
    graph.write_text(
        f"include: [{DEMO / 'push.yaml'}]\nblocks: {{hiss: {{use: blocks.WhiteNoise}}}}\n"
    )
    with pytest.raises(NeedsPython, match=r"noisy.yaml: block 'hiss' .*plain Python"):
        world.make_world(graph, [], "noisy")


@pytest.mark.long
def test_a_robot_that_calls_python_in_its_steps_is_refused(world: ModuleType) -> None:
    with pytest.raises(NeedsPython, match="block 'robot' calls Python in a step of its simulator"):
        world.make_world(DEMO / "push.yaml", ["robot.ground.contact_bias=true"], "push")
