"""What each line, box and point of the views means: one table, drawn as a view of its own."""

from __future__ import annotations

from typing import Literal, NamedTuple

import rerun as rr
import rerun.blueprint as rrb

from foretwin.contracts.simulation import AMBER_FROM, RED_FROM
from foretwin.viewer.colours import (
    CRITICAL,
    DETECTED,
    GHOST,
    NOMINAL,
    REAL,
    ROAD_USER,
    SAFE,
    SHADOW,
    TWIN,
    VIRTUAL,
    WATCH,
    Colour,
)
from foretwin.viewer.log_drive import PLAN, TRAIL
from foretwin.viewer.log_roles import CORRECTION
from foretwin.viewer.rows import Row, static

ROUTE: Colour = (64, 142, 132)


class LegendEntry(NamedTuple):
    """A mark with its meaning."""

    mark: Literal["box", "line", "point"]
    colour: Colour
    meaning: str


ENTRIES: tuple[tuple[LegendEntry, ...], ...] = (
    (
        LegendEntry("box", REAL, "the real car"),
        LegendEntry("box", TWIN, "twin: runs on its own"),
        LegendEntry("box", SHADOW, "shadow: led along"),
        LegendEntry("box", GHOST, "ghost: touches nobody"),
    ),
    (
        LegendEntry("line", NOMINAL, "nominal future"),
        LegendEntry("line", SAFE, "future, harmless"),
        LegendEntry("line", WATCH, f"watch: from {AMBER_FROM:g}"),
        LegendEntry("line", CRITICAL, f"grave: from {RED_FROM:g}"),
    ),
    (
        LegendEntry("line", ROAD_USER, "road user in a future"),
        LegendEntry("point", CRITICAL, "where they touch"),
        LegendEntry("line", PLAN, "plan of the car's ADS"),
        LegendEntry("line", TRAIL, "where the car was"),
    ),
    (
        LegendEntry("line", ROUTE, "route"),
        LegendEntry("line", CORRECTION, "what corrects the twin"),
        LegendEntry("box", DETECTED, "detected road user"),
        LegendEntry("box", VIRTUAL, "virtual road user"),
    ),
)
"""Columns of entries; futures are coloured by criticality, likelihood times risk of a death."""
COLUMN, LINE = 188.0, 24.0
LABEL_X, BELOW = 92.0, 13.0
"""Where a meaning stands beside its mark: Rerun writes it centred, and below its point."""
LEGEND_BOUNDS = rrb.VisualBounds2D(
    x_range=(-20.0, COLUMN * (len(ENTRIES) - 1) + 180.0), y_range=(-14.0, LINE * 3 + 14.0)
)


def legend_rows() -> list[Row]:
    """Return the legend as marks in a plane, each with its meaning beside it."""
    placed = [
        (entry, COLUMN * column, LINE * line)
        for column, entries in enumerate(ENTRIES)
        for line, entry in enumerate(entries)
    ]
    lines = [(e, x, y) for e, x, y in placed if e.mark == "line"]
    boxes = [(e, x, y) for e, x, y in placed if e.mark == "box"]
    points = [(e, x, y) for e, x, y in placed if e.mark == "point"]
    return [
        static(
            "legend/lines",
            rr.LineStrips2D(
                [[[x - 9.0, y], [x + 9.0, y]] for _, x, y in lines],
                colors=[e.colour for e, _, _ in lines],
                radii=rr.Radius.ui_points(2.0),
            ),
        ),
        static(
            "legend/boxes",
            rr.Boxes2D(
                centers=[[x, y] for _, x, y in boxes],
                half_sizes=[[9.0, 5.0]] * len(boxes),
                colors=[e.colour for e, _, _ in boxes],
                radii=rr.Radius.ui_points(1.5),
            ),
        ),
        static(
            "legend/points",
            rr.Points2D(
                [[x, y] for _, x, y in points],
                colors=[e.colour for e, _, _ in points],
                radii=rr.Radius.ui_points(5.0),
            ),
        ),
        static(
            "legend/meanings",
            rr.Points2D(
                [[x + LABEL_X, y - BELOW] for _, x, y in placed],
                labels=[e.meaning for e, _, _ in placed],
                colors=[NOMINAL],
                radii=0.01,
                show_labels=True,
            ),
        ),
    ]
