"""What all pictures share: lines where their numbers say, labels apart, the same bytes each time."""

import io
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from aloft.plotting import (
    COLOURS,
    DARK,
    SHADES,
    Curve,
    Panel,
    Shade,
    draw_panels,
    image,
    new_figure,
    spread,
    style,
    svg_text,
)

from .logs.viewing.browser import PROGRAM, Browser

SVG = "{http://www.w3.org/2000/svg}"
X = np.linspace(0.0, 1.0, 101)


def drawn(panel: Panel) -> str:
    with style():
        figure = new_figure(4.0, 3.0, "a < b")
        draw_panels([(figure.add_subplot(), panel)])
        return svg_text(figure)


def lines_of(text: str, gid: str = "line") -> list[str]:
    """The path data of the lines that were drawn."""
    root = ElementTree.fromstring(text)
    groups = [group for group in root.iter(f"{SVG}g") if group.get("id") == gid]
    return [path.get("d", "") for group in groups for path in group.iter(f"{SVG}path")]


def points(data: str) -> np.ndarray:
    return np.array(re.findall(r"[ML] ([\d.-]+) ([\d.-]+)", data), float)


def test_a_line_goes_through_its_points() -> None:
    text = drawn(
        Panel("y [m]", [Curve("one", np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 1.0]))])
    )
    (data,) = lines_of(text)
    (x0, y0), (x1, y1), (x2, y2) = points(data)
    assert x1 - x0 == pytest.approx(x2 - x1) and x1 > x0
    assert y0 - y1 == pytest.approx(3.0 * (y0 - y2), abs=0.01), "more is higher"
    words = [element.text for element in ElementTree.fromstring(text).iter(f"{SVG}text")]
    assert {"a < b", "y [m]", "time [s]", "one"} <= set(words)


def test_a_line_is_interrupted_where_it_is_not_finite() -> None:
    y = np.where((X > 0.4) & (X < 0.5), np.nan, np.sin(9.0 * X))
    (data,) = lines_of(drawn(Panel("", [Curve("", X, y)])))
    assert data.count("M") == 2


def test_a_constant_line_and_no_line_can_be_drawn() -> None:
    for lines in (
        [Curve("c", X, np.full(101, 2.0))],
        [Curve("", X, np.full(101, np.nan))],
        [],
    ):
        assert "<svg" in drawn(Panel("", lines))


def test_limits_are_told_apart_and_take_no_colour() -> None:
    limit = Curve("limit", X, np.ones(101), limit=True)
    text = drawn(Panel("", [limit, Curve("a", X, X)]))
    assert len(lines_of(text, "limit")) == 1 and len(lines_of(text)) == 1
    assert f"stroke: {COLOURS[0]}" in text and f"stroke: {COLOURS[1]}" not in text


def test_stretches_are_shaded_as_far_as_they_reach() -> None:
    def share(*shades: Shade) -> float:
        with style():
            figure = new_figure(4.0, 3.0)
            draw_panels([(figure.add_subplot(), Panel("", [Curve("", X, X)], shades=shades))])
            pixels = np.asarray(image(figure)).astype(int)
        colour = [int(SHADES["flight"][k : k + 2], 16) for k in (1, 3, 5)]
        return float((np.abs(pixels - colour).max(axis=2) < 4).mean())

    assert share() < 0.001
    assert share(Shade(0.25, 0.75)) / share(Shade(-1.0, 9.0)) == pytest.approx(0.5, abs=0.05)


def test_the_same_data_give_the_same_bytes() -> None:
    panel = Panel(
        "a", [Curve("x", X, X**2), Curve("y", X, X)], shades=[Shade(0.1, 0.2, "push", "p")]
    )
    assert drawn(panel) == drawn(panel)
    assert "date" not in drawn(panel).lower()


def test_labels_are_apart_in_their_order_and_inside() -> None:
    assert spread([0.1, 0.8], 0.1) == [0.1, 0.8]
    found = spread([0.95, 0.5, 1.0, 0.98, 0.5], 0.1)
    assert found == pytest.approx([0.8, 0.5, 1.0, 0.9, 0.6])
    crowded = spread([0.0] * 20, 0.1)
    assert np.diff(sorted(crowded)) == pytest.approx([0.1] * 19) and max(crowded) == 1.0


@pytest.mark.long
@pytest.mark.skipif(
    PROGRAM is None, reason="looks through a real browser; install Debian's chromium"
)
def test_an_svg_is_light_in_print_and_dark_on_a_dark_screen(tmp_path: Path) -> None:
    file = tmp_path / "a.svg"
    file.write_text(drawn(Panel("", [Curve("one", X, X)], shades=[Shade(0.0, 0.5)])))
    shown = {}
    with Browser(tmp_path / "profile", (400, 300)) as browser:
        browser.open(file.as_uri())
        for medium in ("screen", "print"):
            for theme in ("light", "dark"):
                preferred = [{"name": "prefers-color-scheme", "value": theme}]
                browser.ask("Emulation.setEmulatedMedia", media=medium, features=preferred)
                picture = Image.open(io.BytesIO(browser.picture())).convert("RGB")
                shown[medium, theme] = np.asarray(picture)[:250, :350]

    def has(which: tuple[str, str], colour: str) -> bool:
        wanted = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
        return bool((shown[which] == wanted).all(axis=2).sum() > 50)

    for light, dark in (("#ffffff", DARK["#ffffff"]), (COLOURS[0], DARK[COLOURS[0]]),
                        (SHADES["flight"], DARK[SHADES["flight"]])):  # fmt: skip
        assert has(("screen", "dark"), dark) and not has(("screen", "dark"), light)
        for which in (("screen", "light"), ("print", "light"), ("print", "dark")):
            assert has(which, light) and not has(which, dark), (which, light)


def test_a_png_is_light() -> None:
    with style():
        figure = new_figure(4.0, 3.0, "a")
        draw_panels([(figure.add_subplot(), Panel("", [Curve("one", X, X)]))])
        pixels = np.asarray(image(figure))
    assert np.median(pixels) == 255 and (pixels[0] == 255).all()
