"""What a recording shows when it is opened: the robot on the left, the main signals on the right."""

from __future__ import annotations

from typing import Any

from .format import Header, entity_of

MAIN_FIELDS = ("com", "com_velocity", "contact_force", "motor_torque", "motor_speed")
"""Shown as time series where the port that poses the robot has them, in this order."""
MOST_PLOTS = 5


def main_plots(header: Header, pose_port: str | None) -> list[str]:
    """Full names of the fields to plot: the robot's main ones, or just the first of the graph."""
    known = [field.name for field in header.bus.fields if not field.constant]
    if pose_port is None:
        return known[:MOST_PLOTS]
    return [name for field in MAIN_FIELDS if (name := f"{pose_port}.{field}") in known]


def recording_blueprint(header: Header, pose_port: str | None) -> Any:
    """The layout, saved in the file so that it needs no set-up to look at."""
    import rerun.blueprint as rrb

    plots = [
        rrb.TimeSeriesView(origin=entity_of("signals", name), name=name)
        for name in main_plots(header, pose_port)
    ]
    below = rrb.Horizontal(
        rrb.StateTimelineView(origin="states", name="States"),
        rrb.TextLogView(origin="events", name="Events"),
    )
    column = rrb.Vertical(*plots, below)
    if pose_port is None:
        root: Any = column
    else:
        scene = rrb.Spatial3DView(
            origin="world",
            name="Robot",
            eye_controls=rrb.EyeControls3D(position=(1.1, -1.1, 0.6), look_target=(0.0, 0.0, 0.3)),
            line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
        )
        root = rrb.Horizontal(scene, column, column_shares=[2, 3])
    return rrb.Blueprint(
        root,
        rrb.TimePanel(state="collapsed", timeline="t", play_state="playing", loop_mode="all"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
