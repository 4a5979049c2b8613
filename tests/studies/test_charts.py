"""Pictures: which runs go where, and that what is drawn is where it should be."""

import re
from collections.abc import Callable
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.studies.charts import draw_plot, group, reach
from aloft.studies.execution import Run
from aloft.studies.expansion import cells
from aloft.studies.journal import Outcome
from aloft.studies.study import Study
from aloft.studies.summary import summarise

Read = Callable[[str], Study]
SVG = "{http://www.w3.org/2000/svg}"
TEXT = """
arms: {weak: {}, strong: {}}
grid:
  direction: {counter.goal: {from: 0 deg, to: 270 deg, step: 90 deg}}
  force: {counter.stop_at: [10, 20, 30], shown: [10 N, 20 N, 30 N]}
goals: 0.95
plots:
  polar: {kind: polar, angle: direction, radius: force, level: 0.9}
  lines: {kind: lines, x: force, panels: direction, title: "a < b"}
  metric: {kind: lines, x: force, y: tilt_deg, where: {arm: strong}}
  dots: {kind: dots, where: {direction: 0 deg}}
"""


def runs_of(found: Study) -> list[Run]:
    """The weak arm lands up to 20 N but for 0 deg, where it lands 10 N; the strong one always."""
    made = []
    for cell in cells(found):
        force = float(str(cell.coordinates["force_n"]))
        limit = 10 if cell.coordinates["direction_deg"] == 0 else 20
        good = cell.arm == "strong" or force <= limit
        outcome = Outcome(good, "" if good else "fell", metrics={"tilt_deg": force, "word": "x"})
        made += [Run(cell, seed, outcome) for seed in found.seeds]
    return made


def drawn(found: Study, name: str) -> ElementTree.Element:
    made = runs_of(found)
    plot = next(plot for plot in found.plots if plot.name == name)
    return ElementTree.fromstring(draw_plot(found, plot, made, summarise(found, made)))


def words(picture: ElementTree.Element) -> list[str]:
    return [element.text or "" for element in picture.iter(f"{SVG}text")]


def line(picture: ElementTree.Element, gid: str) -> list[tuple[float, float]]:
    """The points of the line with that name."""
    (group,) = [group for group in picture.iter(f"{SVG}g") if group.get("id") == gid]
    path = group.find(f"{SVG}path")
    assert path is not None
    found = re.findall(r"[ML] ([\d.-]+) ([\d.-]+)", path.get("d", ""))
    return [(float(x), float(y)) for x, y in found]


def test_the_polar_curve_is_the_largest_force_up_to_which_all_is_well(study: Read) -> None:
    picture = drawn(study(TEXT), "polar")
    weak, strong = (line(picture, f"line-{number}") for number in (0, 1))
    (x0, top), (left, _), (_, bottom), (right, _), end = strong
    assert end == (x0, top), "the curve is closed"
    middle = (left + right) / 2
    assert x0 == pytest.approx(middle) and bottom - top == pytest.approx(right - left)
    radius = (right - left) / 2
    # forward is up, and to the left is left, as seen from above
    assert left < middle < right and top < bottom
    assert weak[0] == pytest.approx((middle, top + radius * 2 / 3), abs=0.2)
    assert weak[1] == pytest.approx((middle - radius * 2 / 3, top + radius), abs=0.2)
    assert {"weak", "strong", "10", "20", "30", "force [N]", "0°", "90°"} <= set(words(picture))


def test_reach_stops_at_the_first_failure() -> None:
    assert reach({30.0: 1.0, 10.0: 1.0, 20.0: 0.94}, 0.95) == 10.0
    assert reach({10.0: 0.5, 20.0: 1.0}, 0.95) == 0.0
    assert reach({10.0: 0.95, 20.0: 0.95}, 0.95) == 20.0


def test_lines_have_panels_that_share_their_axes_and_text_is_escaped(study: Read) -> None:
    picture = drawn(study(TEXT), "lines")
    assert {"0 deg", "90 deg", "180 deg", "270 deg", "a < b", "100%"} <= set(words(picture))
    names = [f"panel-{panel}-line-{number}" for panel in range(4) for number in range(2)]
    heights = [[y for _, y in line(picture, name)] for name in names]
    assert heights[1] == [heights[1][0]] * 3  # strong at 0 deg: always at the top
    assert heights[0][0] == heights[1][0] < heights[0][1] == heights[0][2]


def test_a_metric_over_an_axis_and_one_that_nobody_has(study: Read) -> None:
    found = study(TEXT)
    assert "tilt_deg" in words(drawn(found, "metric"))
    plot = replace(found.plots[2], y="tilt_dge")
    made = runs_of(found)
    with pytest.raises(
        AloftError, match=r"no run has a metric 'tilt_dge'; the nearest is tilt_deg"
    ):
        draw_plot(found, plot, made, summarise(found, made))


def test_dots_name_every_cell_with_its_goal(study: Read) -> None:
    picture = drawn(study(TEXT), "dots")
    names = [word for word in words(picture) if re.match("weak|strong", word)]
    assert names[0] == "weak, 0 deg, 10 N" and len(names) == 6
    assert words(picture).count("3/3") == 4 and words(picture).count("0/3") == 2


def test_runs_that_differ_only_elsewhere_are_taken_together(study: Read) -> None:
    found = study(TEXT)
    groups = group(runs_of(found), found.plots[0], ("arm",))
    assert {key: (g.n, g.successes) for key, g in groups.items()} == {
        ("weak",): (36, 21), ("strong",): (36, 36),
    }  # fmt: skip
