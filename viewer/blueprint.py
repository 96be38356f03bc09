"""A layout as Rerun's blueprint."""

from __future__ import annotations

import rerun.blueprint as rrb

from foretwin.contracts.layout import Layout, LayoutRow, read_layout
from foretwin.viewer.rows import TIMELINE
from foretwin.viewer.views import view_of

DEFAULT = "drive"


def drive_blueprint(layout: Layout | None = None) -> rrb.Blueprint:
    """Return the blueprint of a layout; None is that of a drive."""
    layout = layout or read_layout(DEFAULT)
    columns = [
        rrb.Vertical(
            *(_row(row) for row in column.rows), row_shares=[row.share for row in column.rows]
        )
        for column in layout.columns
    ]
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=[column.share for column in layout.columns]),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _row(row: LayoutRow) -> rrb.View | rrb.Container:
    if row.beside:
        return rrb.Horizontal(*(view_of(name) for name in row.beside))
    views = [view_of(name) for name in row.tabs]
    return views[0] if len(views) == 1 else rrb.Tabs(*views, active_tab=0)
