"""Drawings: nothing overlaps, lines have right angles, and every wire arrives at its port."""

import time
from functools import cache
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.extensions.studio.diagram.diagram import (
    INTO,
    OUT,
    Diagram,
    DiagramNode,
    DiagramWire,
    diagram,
)
from aloft.extensions.studio.diagram.layout import Drawing, draw, notes_of, size_of
from aloft.runtime.loading import checked_file, checked_text

from .test_layers import NAMES, diagram_of

COMPOSED = """
rate: 1 kHz
blocks:
  fast: {use: blocks.Step, with: {after: 3 V}}
  slow: {use: blocks.Ramp, with: {slope: 1, unit: V}, rate: 100 Hz}
  slower: {use: blocks.Ramp, with: {slope: 1, unit: V}, rate: 10 Hz}
  mixed: {use: blocks.Gain, in: {u: [fast.y, slow.y, slower.y]}}
  late: {use: blocks.Gain, in: {u: {from: [fast.y, "mixed.y.value[0]"], delay: 7}}}
"""


def test_wires_of_a_composite_input_have_their_own_rates_and_one_label() -> None:
    found = diagram(checked_text(COMPOSED, Path("graph.yaml")))
    rates = {w.source[0]: w.transition for w in found.wires if w.target[0] == "mixed"}
    assert rates == {"fast": "", "slow": "holds 100 Hz", "slower": "holds 10 Hz"}
    drawing = draw(found)
    check_drawing(drawing)
    assert sorted(notes_of(drawing).values()) == ["holds 100 Hz, holds 10 Hz", "z⁻⁷"]


def check_drawing(drawing: Drawing) -> None:
    boxes = [box for path, box in drawing.boxes.items() if path not in (INTO, OUT)]
    for number, one in enumerate(boxes):
        for other in boxes[number + 1 :]:
            apart = (
                one.x + one.width < other.x
                or other.x + other.width < one.x
                or one.y + one.height < other.y
                or other.y + other.height < one.y
            )
            assert apart, (one.node.path, other.node.path)
        assert one.x > 0 and one.y > 0
        assert one.x + one.width < drawing.width and one.y + one.height < drawing.height
    for line in drawing.lines:
        for (x0, y0), (x1, y1) in zip(line.points, line.points[1:], strict=False):
            assert abs(x0 - x1) < 0.5 or abs(y0 - y1) < 0.5, "a line is slanted"
            for box in boxes:
                inside = (
                    min(x0, x1) < box.x + box.width - 1
                    and max(x0, x1) > box.x + 1
                    and min(y0, y1) < box.y + box.height - 1
                    and max(y0, y1) > box.y + 1
                )
                assert not inside, f"a line crosses {box.node.path}"
    for wire in drawing.diagram.wires:
        target, source = drawing.boxes[wire.target[0]], drawing.boxes[wire.source[0]]
        end = (target.x, target.y + target.port(wire.target[1], False))
        start = (source.x + source.width, source.y + source.port(wire.source[1], True))
        assert any(_near(line.points[-1], end) for line in drawing.lines), wire
        assert any(_near(line.points[0], start) for line in drawing.lines), wire
    for box in boxes:
        if box.inside is not None:
            check_drawing(box.inside)


def _near(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return abs(a[0] - b[0]) < 1.0 and abs(a[1] - b[1]) < 1.0


def drawn(diagram: Diagram) -> Drawing:
    drawing = draw(diagram)
    check_drawing(drawing)
    return drawing


@given(st.lists(st.tuples(NAMES, NAMES), min_size=1, max_size=24))
def test_any_graph_can_be_drawn(edges: list[tuple[str, str]]) -> None:
    drawn(diagram_of(edges))


@cache
def jump() -> Drawing:
    return drawn(diagram(checked_file("aloft:jump")))


def test_the_jump_fits_on_one_screen() -> None:
    drawing = jump()
    assert drawing.width < 2500 and drawing.height < 1000  # scaled to 0.8 on a screen of 1920


def crossings(drawing: Drawing) -> int:
    """How many points there are in which lines of two nets cross."""
    level, upright = [], []
    for line in drawing.lines:
        for (x0, y0), (x1, y1) in pairwise(line.points):
            if abs(y0 - y1) < 0.5:
                level.append((min(x0, x1) + 0.5, max(x0, x1) - 0.5, y0, line.wire.source))
            else:
                upright.append((min(y0, y1) + 0.5, max(y0, y1) - 0.5, x0, line.wire.source))
    return len({
        (round(x), round(y), *sorted((one, other)))
        for left, right, y, one in level
        for top, low, x, other in upright
        if one != other and left < x < right and top < y < low
    })  # fmt: skip


def test_the_jump_is_read_from_the_robot_to_the_safety_monitor_with_few_crossings() -> None:
    drawing = jump()
    order = sorted(drawing.boxes, key=lambda path: drawing.boxes[path].x)
    assert order[0] == "robot" and order[-1] == "safety"
    assert order.index("estimator") < order.index("dynamics") < order.index("wbc")
    assert 0 < crossings(drawing) < 80  # 170 before places and tracks were sifted


def test_a_thousand_blocks_are_drawn_in_seconds() -> None:
    chance, count = Random(1), 1000
    nodes = {
        f"b{k}": DiagramNode(f"b{k}", f"b{k}", inputs=["a", "b"], outputs=["y"])
        for k in range(count)
    }
    wires = [
        DiagramWire((f"b{max(0, k - 1 - chance.randrange(reach))}", "y"), (f"b{k}", port))
        for k in range(1, count)
        for port, reach in (("a", 12), ("b", 40))
    ]
    began = time.process_time()
    assert len(draw(Diagram(nodes, wires)).boxes) == count
    assert time.process_time() - began < 5.0


@pytest.mark.long
def test_a_graph_of_another_robot_is_drawn() -> None:
    drawn(diagram(checked_file("aloft:robots/go2_jump")))


def test_a_block_is_as_wide_as_its_longest_names_and_as_high_as_its_ports() -> None:
    long = "a_port_with_quite_a_long_name_of_its_own"
    narrow = size_of(DiagramNode("b", "b", inputs=["u"], outputs=["y"]))
    for ports in (["y", long], [long, "y"]):
        left = size_of(DiagramNode("b", "b", inputs=ports, outputs=["y"]))
        right = size_of(DiagramNode("b", "b", inputs=["u"], outputs=ports))
        assert left == right and left[0] > narrow[0] + 100.0 and left[1] > narrow[1]
    both = size_of(DiagramNode("b", "b", inputs=["u", long], outputs=[long]))
    assert both[0] > 1.8 * (left[0] - 20.0)
