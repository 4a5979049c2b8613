"""What a task of a few lines leaves unsaid is chosen from task and robot; what it says stays."""

import math

import pytest
from tests.robots.limbed_robots import quadruped

from aloft.planner.task.recipe import choices, take_off_energy_ratio
from aloft.planner.task.scaling import size_of
from aloft.planner.task.task import JumpTask, make_task
from aloft.robots.description import find_robot

BRUCE = find_robot("bruce")
ASKED = {"name": "a", "rise": "12 cm", "distance_x": "8 cm", "twist": "10 deg"}


def resolved(**values: object) -> JumpTask:
    return make_task({**ASKED, **values}).resolved(BRUCE)


def test_three_lines_are_the_whole_recipe() -> None:
    task = resolved()
    assert (task.impact, task.effort, task.profile) == (True, 0.85, "koala")
    assert (task.weights.force, task.weights.orientation, task.weights.impulse) == (0.01, 20.0, 5.0)
    phase_specs = [
        (phase_spec.phase, phase_spec.time, phase_spec.contacts)
        for phase_spec in task.phase_specs()
    ]
    assert phase_specs == [
        ("squat", 0.4, "all"), ("thrust", 0.21, "all"), ("thrust", 0.04, "toe"),
        ("flight", None, "all"), ("landing", 0.5, "all"),
    ]  # fmt: skip
    assert task.phase_specs()[2].knots == 8
    assert task.margins is not None
    assert task.margins.landing_lean == 0.1
    assert task.margins.landing_limits == {"knee": (-2.1, -0.4)}
    assert (task.margins.joints, task.margins.squat_lean) == (0.06, None)


def test_every_choice_says_why() -> None:
    found = choices(make_task(ASKED), BRUCE)
    assert [each.parameter for each in found] == [
        "impact", "effort", "knots", "phases", "weights.force", "weights.orientation", "weights.impulse",
        "margins.load", "margins.landing_lean", "margins.landing_limits",
        "margins.touchdown_speed", "margins.touchdown_slide", "margins.joints",
    ]  # fmt: skip
    assert all(each.why for each in found)
    assert "asks for 0.75" in found[1].why


@pytest.mark.parametrize(
    ("said", "left"),
    [
        ({"effort": 0.7}, "effort"),
        ({"impact": False}, "impact"),
        ({"phases": None}, "phases"),
        ({"weights": {"force": 0.002}}, "weights.force"),
        ({"margins": {"joints": 0.01}}, "margins.joints"),
    ],
)
def test_what_is_said_stays_and_the_rest_is_chosen(said: dict[str, object], left: str) -> None:
    all_of_it = {each.parameter for each in choices(make_task(ASKED), BRUCE)}
    task = make_task({**ASKED, **said})
    assert {each.parameter for each in choices(task, BRUCE)} == all_of_it - {left}
    group, _, name = left.partition(".")
    kept, wanted = getattr(task.resolved(BRUCE), group), said[group]
    assert (getattr(kept, name) if name else kept) == (wanted[name] if name else wanted)  # type: ignore[index]


def test_no_margins_at_all_may_be_said() -> None:
    assert resolved(margins=None).margins is None


def test_the_times_that_are_said_are_those_of_the_phases() -> None:
    task = resolved(thrust_time=0.3, squat_time="free")
    assert [phase_spec.time for phase_spec in task.phase_specs()] == [None, 0.26, 0.04, None, 0.5]
    assert resolved(thrust_time="free").phases is None, "a free thrust is one on flat feet"


def test_the_papers_own_settings_are_one_word() -> None:
    task = make_task({**ASKED, "recipe": "paper"})
    assert choices(task, BRUCE) == ()
    whole = task.resolved(BRUCE)
    assert (whole.impact, whole.effort, whole.phases, whole.margins) == (False, 1.0, None, None)


@pytest.mark.parametrize("other", [{"formulation": "srbm"}, {"rotation": "360 deg"}])
def test_other_formulations_and_somersaults_are_what_they_say(other: dict[str, object]) -> None:
    assert choices(make_task({**ASKED, **other}), BRUCE) == ()


def test_what_is_chosen_is_chosen_once_and_part_of_the_hash() -> None:
    task = make_task(ASKED)
    whole = task.resolved(BRUCE)
    assert whole.resolved(BRUCE) == whole
    again = make_task(whole.model_dump(mode="json"))
    assert again.hash(BRUCE) == whole.hash(BRUCE) == task.hash(BRUCE)
    assert choices(again, BRUCE) == ()
    assert task.hash(BRUCE) != make_task({**ASKED, "recipe": "paper"}).hash(BRUCE)
    said = {name: getattr(whole, name) for name in ("impact", "effort", "knots", "phases")}
    said |= {
        "weights": whole.weights,
        "margins": whole.margins,
        "recipe": "paper",
        "squat_time": 0.4,
        "landing_time": 0.5,
    }
    assert make_task({**ASKED, **said}).hash(BRUCE) == task.hash(BRUCE)


def test_more_is_spent_on_what_asks_for_more() -> None:
    efforts = [resolved(rise=rise, distance_x=0.0, twist=0.0).effort for rise in (0.1, 0.2, 0.3)]
    assert efforts[0] == 0.85 < efforts[1] < efforts[2] == 0.92
    low, high = ({"name": "a", "rise": rise, "landing_height": 0.05} for rise in (0.1, 0.2))
    assert take_off_energy_ratio(make_task(low), BRUCE) < take_off_energy_ratio(
        make_task(high), BRUCE
    )


def test_far_jumps_keep_the_torso_off_the_thighs() -> None:
    far = resolved(distance_x=0.5, twist=0.0)
    assert far.margins is not None
    assert far.margins.squat_lean == 0.9
    for rise, distance, lean in ((0.15, 0.3, 0.9), (0.12, 0.3, None), (0.15, 0.15, None)):
        margins = resolved(rise=rise, distance_x=distance, twist=0.0).margins
        assert margins is not None and margins.squat_lean == lean
    back = resolved(rise=0.15, distance_x=-0.3, twist=0.0).margins
    assert back is not None and back.squat_lean is None


@pytest.mark.parametrize(
    ("height", "lean", "gap"),
    [("10 cm", 0.85, 0.017), ("-10 cm", None, 0.017), ("-30 cm", None, 0.027)],
)
def test_a_step_is_kept_away_from_and_not_lain_down_in_front_of(
    height: str, lean: float | None, gap: float
) -> None:
    margins = resolved(rise="16 cm", distance_x="18 cm", landing_height=height).margins
    assert margins is not None
    assert (margins.squat_lean, margins.step) == (lean, gap)
    row = resolved(landing_height=height, repeat=2).margins
    assert row is not None and row.squat_lean is None, "in a row nothing squats in front of a step"


def test_feet_clear_a_step_lower_than_their_share_by_its_height_alone() -> None:
    def clearance(robot: str, height: float) -> float:
        asked = {"name": "a", "rise": 0.2, "distance_x": 0.4, "landing_height": height}
        return make_task(asked).resolved(find_robot(robot)).foot_clearance

    share = 0.12 * size_of(find_robot("g1")).height
    assert share > 0.07
    assert clearance("g1", 0.03) == pytest.approx(0.04)
    assert clearance("g1", 0.06) == pytest.approx(0.06)
    assert clearance("g1", 0.15) == pytest.approx(share, abs=1e-3)
    assert clearance("bruce", 0.02) == clearance("bruce", 0.08) < 0.04


def test_heels_rise_first_where_the_ankles_can_thrust_on_the_toes() -> None:
    def contacts(robot: str) -> list[str]:
        task = make_task({"name": "a", "rise": 0.05}).resolved(find_robot(robot))
        return [
            phase_spec.contacts for phase_spec in task.phase_specs() if phase_spec.phase == "thrust"
        ]

    assert contacts("bruce") == contacts("talos") == ["all", "toe"]
    assert contacts("g1") == ["all"]


def test_a_jump_that_is_low_beside_the_robot_leaves_the_ground_with_a_least_speed() -> None:
    def least(robot: str, rise: float) -> float | None:
        margins = make_task({"name": "a", "rise": rise}).resolved(find_robot(robot)).margins
        assert margins is not None
        return margins.lift_off_speed

    assert least("talos", 0.05) == pytest.approx(math.sqrt(2.0 * 9.81 * 0.75 * 0.05), abs=0.005)
    assert least("talos", 0.1) is None
    assert least("g1", 0.05) is None  # it does not stand up onto its toes
    assert least("bruce", 0.05) is None  # he is half as high
    assert least("bruce", 0.03) is not None
    assert least("go2", 0.02) is None  # balls have no toes to stand up onto


@pytest.mark.parametrize(
    ("rise", "height", "speed", "slide"),
    [("25 cm", "0 cm", 1.7, 0.6), ("8 cm", "-20 cm", 1.7, 0.6), ("8 cm", "-35 cm", 1.8, None),
     ("12 cm", "-35 cm", 2.3, None), ("12 cm", "-45 cm", None, None)],
)  # fmt: skip
def test_feet_come_down_slowly_except_from_very_high_up(
    rise: str, height: str, speed: float | None, slide: float | None
) -> None:
    margins = resolved(rise=rise, distance_x="25 cm", twist=0.0, landing_height=height).margins
    assert margins is not None
    assert (margins.touchdown_speed, margins.touchdown_slide) == (speed, slide)
    said = resolved(rise=rise, landing_height=height, margins={"touchdown_slide": 2.0}).margins
    assert said is not None and said.touchdown_slide == 2.0


def test_from_high_up_the_toes_land_first_with_all_of_the_motors() -> None:
    deep = {"rise": "8 cm", "distance_x": "25 cm", "twist": 0.0, "landing_height": "-35 cm"}
    task = resolved(**deep)
    landing = [
        (phase_spec.phase, phase_spec.time, phase_spec.contacts)
        for phase_spec in task.phase_specs()[-2:]
    ]
    assert landing == [("landing", 0.04, "toe"), ("landing", 0.46, "all")]
    assert task.margins is not None
    assert (task.effort, task.margins.landing_effort) == (0.85, 1.0)


@pytest.mark.parametrize(
    "other",
    [{"twist": "20 deg"}, {"distance_y": "5 cm"}, {"landing_height": "-20 cm"}, {"margins": None},
     {"landing_height": "-45 cm"}, {"repeat": 2}],
)  # fmt: skip
def test_toes_land_first_only_straight_ahead_from_a_height_they_can_bear(
    other: dict[str, object],
) -> None:
    deep = {"rise": "8 cm", "distance_x": "25 cm", "twist": 0.0, "landing_height": "-35 cm"}
    task = resolved(**(deep | other))
    assert task.phase_specs()[-1].contacts == task.phase_specs()[-2].contacts == "all"
    assert task.margins is None or task.margins.landing_effort is None


def test_a_robot_without_soles_has_no_toe_phase() -> None:
    robot = quadruped()
    task = make_task({"name": "a", "robot": "quadruped", "rise": 0.1}).resolved(robot)
    assert task.phases is None
    assert task.margins is not None
    assert task.margins.landing_limits, "it has knees all the same"


def test_balls_roll_on_and_knees_that_fold_keep_higher() -> None:
    soles, balls = find_robot("bruce"), quadruped()
    chosen = {}
    for robot in (soles, balls):
        task = make_task({"name": "a", "rise": 0.12, "distance_x": 0.3, "landing_height": 0.05})
        chosen[robot.name] = {c.parameter: c.value for c in choices(task, robot)}
        level = {
            c.parameter: c.value for c in choices(make_task({"name": "b", "rise": 0.1}), robot)
        }
        assert ("margins.step" in level) is (robot is balls), "on level ground it is for the knees"
    slow = size_of(balls).slow
    assert chosen["bruce"]["margins.touchdown_slide"] == pytest.approx(0.6, rel=0.02)
    assert chosen[balls.name]["margins.touchdown_slide"] == pytest.approx(1.2 * slow, rel=0.02)
    sag = chosen[balls.name]["margins.step"] - chosen["bruce"]["margins.step"]
    assert sag == pytest.approx(0.06 * size_of(balls).height, abs=1e-3)


def test_a_row_comes_to_balance_between_its_jumps_and_leaves_on_the_toes() -> None:
    phase_specs = (
        make_task({"name": "a", "rise": "6 cm", "repeat": 2}).resolved(BRUCE).phase_specs()
    )
    assert [(phase_spec.phase, phase_spec.time, phase_spec.contacts) for phase_spec in phase_specs] == [
        ("squat", 0.4, "all"), ("thrust", 0.21, "all"), ("thrust", 0.04, "toe"), ("flight", None, "all"),
        ("landing", 0.3, "all"), ("thrust", 0.26, "all"), ("thrust", 0.04, "toe"),
        ("flight", None, "all"), ("landing", 0.5, "all"),
    ]  # fmt: skip


def test_the_time_on_the_ground_that_is_said_is_kept() -> None:
    said = make_task({"name": "a", "rise": "6 cm", "repeat": 2, "contact_time": "0.4 s"})
    phase_specs = said.resolved(BRUCE).phase_specs()
    assert [phase_spec.time for phase_spec in phase_specs[4:7]] == [0.2, 0.16, 0.04]
    free = make_task({"name": "a", "rise": "6 cm", "repeat": 2, "contact_time": "free"})
    assert free.resolved(BRUCE).phases is None, "a free time is found on flat feet"


def test_backwards_feet_may_slide_at_touchdown() -> None:
    margins = resolved(distance_x="-10 cm").margins
    assert margins is not None
    assert (margins.touchdown_speed, margins.touchdown_slide) == (1.7, None)


@pytest.mark.parametrize(
    ("said", "time", "load"),
    [
        ({"rise": "18 cm"}, 0.4, 0.4),
        ({"rise": "23 cm"}, 0.45, 0.5),
        ({"rise": "25 cm"}, 0.5, 0.6),
        ({"distance_x": "-25 cm"}, 0.4, 0.4),
        ({"rise": "25 cm", "distance_x": "20 cm"}, 0.4, 0.4),
        ({"distance_x": "-30 cm"}, 0.5, 0.6),
        ({"rise": "25 cm", "twist": "90 deg"}, 0.4, 0.4),
        ({"rise": "25 cm", "landing_height": "10 cm"}, 0.4, 0.4),
        ({"rise": "25 cm", "squat_time": "0.45 s", "margins": {"load": 0.5}}, 0.45, 0.5),
    ],
)
def test_a_deep_squat_takes_longer_with_more_load_on_the_ground(
    said: dict[str, object], time: float, load: float
) -> None:
    task = resolved(**{"rise": 0.1, "distance_x": 0.0, "twist": 0.0, **said})
    assert task.margins is not None
    assert (task.phase_specs()[0].time, task.margins.load) == (time, load)


@pytest.mark.parametrize(("distance", "speed"), [(0.0, 1.7), (0.3, None)])
def test_high_jumps_in_place_come_down_slowly_too(distance: float, speed: float | None) -> None:
    margins = resolved(rise="32 cm", distance_x=distance, twist=0.0).margins
    assert margins is not None and margins.touchdown_speed == speed
