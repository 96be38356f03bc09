"""Lights in the window: whose colour is known, by whose word, and nothing twice."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import rerun as rr

from foretwin.contracts.lights import ShownLight, ShownLights
from foretwin.contracts.signals import Signal
from foretwin.contracts.simulation import WorldNotice
from foretwin.contracts.world import World
from foretwin.viewer.colours import CRITICAL, SAFE
from foretwin.viewer.log_lights import FAINT, PATH, LightsLog
from tests.viewer import scene
from tests.viewer.shown import monitor_of


def head(group: str, x_m: float, z_m: float = 5.5) -> Signal:
    return Signal(
        id=f"{group} at {x_m:g}",
        osm_node=None,
        group_id=group,
        lane_ids=(),
        position=np.array([x_m, 1.0, z_m]),
        yaw_rad=0.0,
        source="tagged",
    )


def lit_junction() -> World:
    heads = (head("a", 10.0), head("b", 20.0), head("a", 30.0, 0.0))
    return msgspec.structs.replace(scene.junction(), signals=heads)


def shown(**colours: tuple[Any, Any]) -> ShownLights:
    lights = [ShownLight(group_id=g, colour=c, why=why) for g, (c, why) in colours.items()]
    return ShownLights(stamp_ns=0, world_id=scene.WORLD_ID, lights=tuple(lights))


def points_of(components: Any) -> tuple[list[list[float]], list[tuple[int, int, int]]]:
    places = components.positions.as_arrow_array().to_pylist()
    packed = components.colors.as_arrow_array().to_pylist()
    return places, [(one >> 24, one >> 16 & 255, one >> 8 & 255) for one in packed]


def test_each_head_has_its_groups_colour_and_a_plan_alone_is_faint() -> None:
    log = LightsLog(scene.DRIVE_FRAME)
    log.know(lit_junction())
    (row,) = log.rows(shown(a=("red", "heard"), b=("green", "plan"), gone=("red", "set")), 7)
    assert (row.path, row.drive_ns) == (PATH, 7)
    places, colours = points_of(row.components)
    assert [round(z_m, 2) for _, _, z_m in places] == [5.5, 5.0, 5.5]
    faint = tuple(round(part * FAINT) for part in SAFE)
    assert colours == [CRITICAL, CRITICAL, faint]
    apart_m = np.hypot(*(np.array(places[1]) - places[0])[:2])
    assert abs(apart_m - 20.0) < 0.05


def test_a_row_is_made_only_where_a_colour_changes() -> None:
    log = LightsLog(scene.DRIVE_FRAME)
    assert log.rows(shown(a=("red", "heard")), 1) == [], "its heads are not known yet"
    log.know(lit_junction())
    assert log.rows(shown(a=("red", "heard")), 2) != []
    assert log.rows(shown(a=("red", "heard")), 3) == []
    assert log.rows(shown(a=("red", "plan")), 4) != []
    (row,) = log.rows(shown(a=("dark", "heard")), 5)
    assert isinstance(row.components, rr.Clear)
    assert log.rows(ShownLights(stamp_ns=0, world_id=None), 6) == []


def test_the_window_shows_them_once_the_world_is_there() -> None:
    monitor = monitor_of(lambda _: lit_junction())
    told = shown(a=("amber", "heard"))
    assert monitor.handle("lights", told) == []
    monitor.handle("world", WorldNotice(world_id=scene.WORLD_ID, intersection_id="x1", file="f"))
    (row,) = monitor.handle("lights", told)
    assert isinstance(row.components, rr.Points3D)
