"""The legend names every colour that the views draw with, and the map shows all of the way."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.roads_shown import RoadsShown, StreetName
from foretwin.viewer import log_drive, log_roles, log_scenarios
from foretwin.viewer.legend import ENTRIES, ROUTE, legend_rows
from foretwin.viewer.log_roads import rows_of_roads
from tests.viewer.shown import Shown

COVERS = ("foretwin.viewer.log_roads",)


def test_each_colour_of_cars_and_futures_is_explained_once() -> None:
    explained = [(entry.mark, entry.colour) for column in ENTRIES for entry in column]
    assert len(explained) == len(set(explained))
    colours = {colour for _, colour in explained}
    assert colours >= {log_roles.CARS[role][0] for role in ("real", "twin", "shadow", "ghost")}
    assert colours >= {log_scenarios.SAFE, log_scenarios.WATCH, log_scenarios.CRITICAL}
    assert colours >= {log_scenarios.NOMINAL, log_scenarios.ROAD_USER, log_drive.PLAN, ROUTE}


def test_every_entry_has_its_mark_and_its_meaning() -> None:
    shown = Shown(legend_rows())
    entries = [entry for column in ENTRIES for entry in column]
    meanings = shown["legend/meanings"].labels.as_arrow_array().to_pylist()
    assert meanings == [entry.meaning for entry in entries]
    marks = [
        len(shown["legend/lines"].strips.as_arrow_array()),
        len(shown["legend/boxes"].half_sizes.as_arrow_array()),
        len(shown["legend/points"].positions.as_arrow_array()),
    ]
    assert sum(marks) == len(entries)
    assert all(row.drive_ns is None for row in shown.rows)


def test_the_map_holds_every_road_the_route_and_names_that_the_fonts_have() -> None:
    roads = RoadsShown(
        xy_m=np.arange(10.0).reshape(5, 2),
        counts=np.array([2, 3]),
        routes=(np.array([[0.0, 1.0], [2.0, 3.0]]),),
        names=(StreetName(name="Mill Lane / 東", x_m=1.0, y_m=2.0),),
    )
    shown = Shown(rows_of_roads(roads))
    strips = shown["map/roads"].strips.as_arrow_array().to_pylist()
    assert [len(strip) for strip in strips] == [2, 3]
    assert [point[:2] for point in strips[1]] == [[4.0, 5.0], [6.0, 7.0], [8.0, 9.0]]
    assert len(shown["map/route"].strips.as_arrow_array()) == 1
    assert shown["map/names"].labels.as_arrow_array().to_pylist() == ["Mill Lane / …"]


def test_a_map_without_a_route_or_roads_is_shown_as_far_as_it_is_there() -> None:
    none = np.empty((0, 2))
    assert rows_of_roads(RoadsShown(xy_m=none, counts=none[:, 0], routes=(), names=())) == []
