"""What a run shows when it is opened, made from the graph: the robot in 3D and its states on the
left; on the right the main signals, and behind them every block's, the times and the graph."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..file.format import EVENTS, GRAPH, TIMES, WORLD, Header
from .plot_views import Shown, block_tabs, main_plots
from .scene_ports import scene_ports
from .state_lanes import Lane, lanes_of

LANES = ("active", "solved")
"""The truth values that have lanes in the first picture; named numbers such as phases all have."""
HIDDEN_LANES = ("mode",)


def recording_blueprint(
    header: Header, shown: Sequence[Shown] = (Shown(),), *, live: bool = False
) -> Any:
    """The layout, saved in the file so that it needs no set-up to look at.

    ``shown`` are the runs in the stream, by default one; of several, each entity has its root.
    """
    import rerun.blueprint as rrb

    ports = scene_ports(header)
    main = main_plots(header, ports, shown)
    columns = 2 if len(main) > 3 else 1
    right = rrb.Tabs(
        rrb.Grid(*main, grid_columns=columns, name="Main signals"),
        *block_tabs(header, shown),
        rrb.TextDocumentView(origin=f"{shown[0].root}{TIMES}", name="Block times"),
        rrb.TextDocumentView(origin=f"{shown[0].root}{GRAPH}", name="Graph"),
        active_tab=0,
    )
    below = rrb.Tabs(
        states_view(header, shown),
        rrb.TextLogView(
            origin="/", contents=[f"{run.root}{EVENTS}" for run in shown], name="Events"
        ),
        active_tab=0,
    )
    left = rrb.Vertical(scene_view(shown), below, row_shares=[3, 2]) if ports else below
    panel = {"play_state": "following"} if live else {"play_state": "playing", "loop_mode": "all"}
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[2, 3]),
        rrb.TimePanel(state="collapsed", timeline="t", **panel),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def scene_view(shown: Sequence[Shown]) -> Any:
    """The robot, or the robots, in 3D; the eye stands to the right and in front of it."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=WORLD if not shown[0].root else "/",
        contents=[f"/{run.root}{WORLD}/**" for run in shown],
        name="Robot",
        eye_controls=rrb.EyeControls3D(position=(0.6, -0.8, 0.4), look_target=(0.0, 0.0, 0.25)),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )


def main_lanes(header: Header) -> list[Lane]:
    """The lanes of the first picture."""
    return [
        lane
        for field in header.bus.fields
        if not field.constant
        and ((field.values and field.field_name not in HIDDEN_LANES) or field.field_name in LANES)
        for lane in lanes_of(field, header.robot)
    ]


def states_view(header: Header, shown: Sequence[Shown]) -> Any:
    """Phases, contacts and whether the problem was solved, a lane each."""
    import rerun.blueprint as rrb

    lanes = [
        f"/{run.root}{lane.entity}"
        for run in shown
        for lane in main_lanes(header)
        if len(shown) == 1 or lane.told  # contacts of two runs would fill the view
    ]
    return rrb.StateTimelineView(origin="/", contents=lanes or ["states/**"], name="States")
