"""The picture of a plan: well-formed SVG with the plan's own figures, postures and panels."""

from pathlib import Path
from xml.etree import ElementTree

from aloft.planner.drawing.picture import write_picture
from aloft.planner.task.plan import JumpPlan
from aloft.robots.description import find_robot

SVG = "{http://www.w3.org/2000/svg}"


def test_a_plans_picture(by_hand: JumpPlan, tmp_path: Path) -> None:
    robot = find_robot("bruce")
    path = write_picture(tmp_path / "a" / "p.svg", by_hand, robot)
    root = ElementTree.parse(path).getroot()
    texts = [element.text or "" for element in root.iter(f"{SVG}text")]
    assert any(text.startswith("by_hand: rise 8.5 cm, flight 291 ms") for text in texts)
    assert {"right_toe", "pitch", "up", "time [s]", "motor torque [N m]"} <= set(texts)
    assert {"squat", "flight", "landing", "ground", "limit at its speed"} <= set(texts)
    named = [group.get("id", "") for group in root.iter(f"{SVG}g")]
    assert named.count("line") > 40
    assert sum(name.startswith("centre-of-mass-") for name in named) == 9, "one in every posture"
    assert sum(name.startswith("posture-") for name in named) == 9 * len(robot.feet)
    before = path.read_bytes()
    assert write_picture(path, by_hand, robot).read_bytes() == before, "the same bytes each time"
