"""Pictures: well-formed SVG with the plan's own figures; charts scale and label as they should."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from aloft.planner.drawing.line_chart import Chart, Line, page, pieces, ticks
from aloft.planner.drawing.picture import write_picture
from aloft.planner.task.plan import JumpPlan
from aloft.robots.description import find_robot

SVG = "{http://www.w3.org/2000/svg}"


def test_a_plans_picture(by_hand: JumpPlan, tmp_path: Path) -> None:
    root = ElementTree.parse(write_picture(tmp_path / "a" / "p.svg", by_hand, find_robot("bruce")))
    texts = [element.text or "" for element in root.iter(f"{SVG}text")]
    assert any(text.startswith("by_hand: rise 8.5 cm, flight 291 ms") for text in texts)
    assert {"right_toe", "pitch", "up"} <= set(texts)
    assert len(list(root.iter(f"{SVG}polyline"))) > 40
    assert {"squat", "flight", "landing", "ground", "allowed at that speed"} <= set(texts)
    assert len(list(root.iter(f"{SVG}circle"))) == 9, "the centre of mass in every posture"


@pytest.mark.parametrize(
    ("low", "high", "found"),
    [
        (0.0, 1.0, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (-3.0, 260.0, [0.0, 100.0, 200.0]),
        (0.31, 0.32, None),
    ],
)
def test_ticks_are_round_and_inside(low: float, high: float, found: list[float] | None) -> None:
    values = ticks(low, high, 5)
    assert all(low - 1e-9 <= value <= high + 1e-9 for value in values)
    assert found is None or values == found
    assert 1 <= len(values) <= 6


def test_a_line_breaks_where_it_is_not_finite() -> None:
    x, y = np.arange(5.0), np.array([0.0, 1.0, np.nan, 2.0, 3.0])
    assert pieces(x, y) == [[(0.0, 0.0), (1.0, 1.0)], [(3.0, 2.0), (4.0, 3.0)]]


def test_a_chart_puts_its_lines_where_they_belong() -> None:
    chart = Chart("a < b", [Line("one", np.array([0.0, 1.0]), np.array([0.0, 10.0]))])
    text = page("whole", [chart.svg(0.0, 0.0, 154.0, 154.0)], 160.0, 160.0)
    root = ElementTree.fromstring(text)
    (points,) = [line.get("points", "") for line in root.iter(f"{SVG}polyline")]
    (x0, y0), (x1, y1) = (map(float, pair.split(",")) for pair in points.split())
    assert (x0, x1) == (46.0, 146.0)
    assert y0 > y1, "more is higher"
    assert "a &lt; b" in text


def test_a_constant_line_can_be_drawn() -> None:
    flat = Chart("flat", [Line("", np.array([0.0, 1.0]), np.array([2.0, 2.0]))])
    assert "NaN" not in flat.svg(0.0, 0.0, 100.0, 100.0).replace("nan", "NaN")
