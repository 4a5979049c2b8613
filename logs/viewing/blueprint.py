"""The layout in which the viewer shows a run, made from the graph.

The robot in 3D and its states are on the left. On the right are tabs: the main signals, each
block's signals, the blocks' times and the graph. Of a graph without a robot the tabs fill the window, with
states and events in a strip below them.

A user's own layout is read by ``own_layout``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..file.format import (
    DIAGRAM,
    EVENTS,
    GRAPH,
    TIMES,
    WORLD,
    Header,
)
from .plot_views import ShownRun, block_tabs, main_plots
from .robot_shapes import eye_controls
from .scene import EYE
from .scene_ports import scene_ports
from .state_lanes import Lane, all_lanes

LANES = ("active", "solved")
"""The truth values that have lanes beside those of the named numbers, such as phases."""
HIDDEN_LANES = ("mode",)


def recording_blueprint(
    header: Header,
    shown: Sequence[ShownRun] = (ShownRun(),),
    *,
    live: bool = False,
    first_tabs: Sequence[Any] = (),
    follow: bool = True,
    main_only: bool = False,
    diagram: bool = False,
) -> Any:
    """Make the layout, saved in the file so that it needs no set-up to look at.

    ``shown`` are the runs in the stream, by default one; of several, each entity has its root.
    ``first_tabs`` come before those made from the graph; with ``follow`` the camera goes along with
    the robot. With ``main_only`` blocks have no tabs, because their signals are not drawn.
    With ``diagram`` there is a tab for the picture of the graph, at ``DIAGRAM``.
    """
    import rerun.blueprint as rrb

    ports = scene_ports(header)
    main = main_plots(header, ports, shown)
    columns = 2 if len(main) > 3 else 1
    right = rrb.Tabs(
        *first_tabs,
        rrb.Grid(*main, grid_columns=columns, name="Main signals"),
        *(() if main_only and ports else block_tabs(header, shown)),
        rrb.TextDocumentView(origin=f"{shown[0].root}{TIMES}", name="Block times"),
        rrb.TextDocumentView(origin=f"{shown[0].root}{GRAPH}", name="Graph"),
        *((rrb.Spatial2DView(origin=f"/{DIAGRAM}", name="Diagram"),) if diagram else ()),
        active_tab=0,
    )
    states = [states_view(header, shown)] if ports or main_lanes(header) else []
    below = rrb.Tabs(*states, events_view(shown), active_tab=0)
    whole: Any = rrb.Vertical(right, below, row_shares=[5, 1])
    if ports:
        left = rrb.Vertical(scene_view(header, shown, follow=follow), below, row_shares=[3, 2])
        whole = rrb.Horizontal(left, right, column_shares=[2, 3])
    panel = {"play_state": "following"} if live else {"play_state": "playing", "loop_mode": "all"}
    return rrb.Blueprint(
        whole,
        rrb.TimePanel(state="collapsed", timeline="t", **panel),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def events_view(shown: Sequence[ShownRun]) -> Any:
    """Make the view of the events: each text begins with its time, as the viewer's column cuts
    times off."""
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

    return rrb.TextLogView(
        origin="/",
        contents=[f"{run.root}{EVENTS}" for run in shown],
        name="Events",
        columns=rrb.TextLogColumns(
            timeline_columns=[
                TimelineColumn("t", visible=False),
                TimelineColumn("tick", visible=False),
            ],
            text_log_columns=[
                TextLogColumn(TextLogColumnKind.LogLevel),
                TextLogColumn(TextLogColumnKind.Body),
            ],
        ),
    )


def scene_view(header: Header, shown: Sequence[ShownRun], *, follow: bool = True) -> Any:
    """Make the view of the robot in 3D; of a comparison both robots."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=WORLD if not shown[0].root else "/",
        contents=[f"/{run.root}{WORLD}/**" for run in shown],
        name="Robot",
        eye_controls=eye_controls(
            header.robot, follow=f"/{shown[0].root}{WORLD}/{EYE}" if follow else None
        ),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )


def main_lanes(header: Header) -> list[Lane]:
    """Return the lanes that are shown at first."""
    return [lane for lane in all_lanes(header) if is_main(lane)]


def is_main(lane: Lane) -> bool:
    """Tell whether a lane is shown at first."""
    name = lane.field.field_name
    return name in LANES or (bool(lane.field.values) and name not in HIDDEN_LANES)


def states_view(header: Header, shown: Sequence[ShownRun]) -> Any:
    """Make one lane each for phases, contacts and whether the quadratic program was solved."""
    import rerun.blueprint as rrb

    lanes = [
        f"/{run.root}{lane.entity}"
        for run in shown
        for lane in main_lanes(header)
        if len(shown) == 1 or lane.told  # contacts of two runs would fill the view
    ]
    return rrb.StateTimelineView(origin="/", contents=lanes or ["states/**"], name="States")
