"""A junction with lights and a slip road that has a sign of its own, drawn in metres."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.world import Connection, StopLine, World
from foretwin.world_gen.osm.osm_map import OsmMap
from tests.world_gen.drawn_maps import GERMANY, IRELAND, Tags, drawn_map, world_of

SIGN = 31
_WAY = np.array([[0.0, -30.0], [4.0, -14.0], [13.0, -5.0], [30.0, 0.0]])
_GIVE_WAY: Tags = {"highway": "give_way"}


def slip_map(share: float = 0.6, *, sign: Tags = _GIVE_WAY, left_hand: bool = False) -> OsmMap:
    """Stem meets Main Street under lights; 30 m before, a slip road parts to the near side.

    Its sign, node 31, stands at a `share` of its length. Where traffic keeps left all is
    mirrored, east for west.
    """
    steps = np.hypot(*np.diff(_WAY, axis=0).T)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    at = share * arc[-1]
    place = np.array([np.interp(at, arc, _WAY[:, 0]), np.interp(at, arc, _WAY[:, 1])])
    bends = [(21 + i, xy, a) for i, (xy, a) in enumerate(zip(_WAY, arc, strict=True))]
    along = sorted([*bends, (SIGN, place, at)], key=lambda item: item[2])
    flip = -1.0 if left_hand else 1.0
    far = {0: (0.0, 0.0), 1: (120.0, 0.0), 3: (-120.0, 0.0), 4: (0.0, -120.0)}
    lights = {41: (10.0, 0.0), 43: (-10.0, 0.0), 44: (0.0, -10.0)}
    drawn = {**far, **lights, **{node: (float(xy[0]), float(xy[1])) for node, xy, _ in along}}
    main: Tags = {"highway": "secondary", "name": "Main Street"}
    light: Tags = {"highway": "traffic_signals", "traffic_signals:direction": "forward"}
    return drawn_map(
        {node: (flip * x, y) for node, (x, y) in drawn.items()},
        [
            (11, [1, 24, 41, 0], main),
            (13, [3, 43, 0], main),
            (14, [4, 21, 44, 0], {"highway": "secondary", "name": "Stem"}),
            (15, [n for n, _, _ in along], {"highway": "secondary_link", "oneway": "yes"}),
        ],
        node_tags={**dict.fromkeys(lights, light), SIGN: sign},
        origin=IRELAND if left_hand else GERMANY,
    )


def slip_world(share: float = 0.6, **options: object) -> World:
    """Return the World of `slip_map`."""
    return world_of(slip_map(share, **options))  # type: ignore[arg-type]


def node_at(osm: OsmMap, world: World, node: int) -> Array:
    """Return where (2,) a node of the map lies in a World."""
    return local_from_geo(world.frame, *osm.locations[node]).reshape(2)


def lines_inside(world: World) -> list[tuple[StopLine, Connection]]:
    """Return the stop lines at signs inside junctions, each with its connection."""
    by_id = {c.id: c for c in world.connections}
    return [
        (line, by_id[line.connection_id])
        for line in world.stop_lines
        if line.connection_id is not None
    ]


def check_lines(world: World) -> int:
    """Fail where a line at a sign inside does not lie across its path; return their number."""
    lanes = {lane.id for lane in world.lanes}
    found = lines_inside(world)
    for line, connection in found:
        assert line.lane_id == connection.from_lane_id
        assert line.lane_id in lanes
        assert line.control.source == "tagged"
        path = shapely.LineString(connection.centerline)
        left, right = line.ends
        middle = shapely.Point((left + right) / 2.0)
        assert path.distance(middle) < 0.002
        assert np.hypot(*(right - left)) == pytest.approx(connection.width_m.value, abs=0.003)
        at_m = path.project(middle)
        before, after = path.interpolate(at_m - 0.2), path.interpolate(at_m + 0.2)
        ahead = np.array([after.x - before.x, after.y - before.y])
        across = (right - left) @ ahead / np.hypot(*ahead) / np.hypot(*(right - left))
        assert abs(across) < 0.1
        assert ahead[0] * (left - right)[1] - ahead[1] * (left - right)[0] > 0.0
    return len(found)
