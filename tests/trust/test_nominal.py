"""The nominal future beside simpler forecasts, on a real drive in its real map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.trust.drawn_road import draw_road
from tests.trust.nominal import errors_m, mean_up_to
from tests.trust.nominal_passes import passes

FRAME = LocalFrame(GeoPoint(50.83, 12.92))


@pytest.mark.real_data
@pytest.mark.judge
def test_the_nominal_future_is_best_at_every_horizon(tmp_path: Path) -> None:
    first, *_ = passes(["gendarmenmarkt"], [], tmp_path)
    found = errors_m(first._replace(rounds=first.rounds[::4]))
    mean_m = {name: mean_up_to(errors) for name, errors in found.items()}
    known = mean_m.pop("known path")
    ours = mean_m.pop("nominal")

    assert len(first.rounds) > 450
    for name, theirs in mean_m.items():
        assert (np.array(ours) < theirs).all(), name
    assert ours[1] < 1.25 * known[1]
    assert ours[3] < 1.1 * known[3]

    shares = np.array([one.share for one in first.drive.outcomes])
    assert len(shares) > 3000
    assert np.mean((shares >= 0.1) & (shares <= 0.9)) == pytest.approx(0.8, abs=0.1)


def test_a_drawn_road_lies_about_where_it_was_driven_and_has_junctions(tmp_path: Path) -> None:
    turn = np.linspace(0.0, np.pi / 2.0, 20)
    track = np.concatenate(
        [
            np.column_stack([np.arange(0.0, 300.0), np.zeros(300)]),
            np.column_stack([300.0 + 12.0 * np.sin(turn), 12.0 - 12.0 * np.cos(turn)]),
            np.column_stack([np.full(300, 312.0), np.arange(13.0, 313.0)]),
        ]
    )
    osm = read_map(draw_road(track, FRAME, tmp_path / "road.osm", seed=1, speed_limit_kmh=70))
    graph = build_road_graph(osm)
    own = [edge for edge in graph.edges if edge.name == "Road 0"]
    nodes = np.concatenate([edge.xy_m for edge in own])
    lat, lon = graph.frame.origin.lat_deg, graph.frame.origin.lon_deg
    nodes = nodes + local_from_geo(FRAME, lat, lon)
    away = np.hypot(*np.moveaxis(nodes[:, None] - track, -1, 0)).min(axis=1)

    assert 0.1 < np.median(away) < 1.0
    assert away.max() < 3.0
    assert all(edge.limit_forward_mps.value == pytest.approx(70 / 3.6) for edge in own)
    assert len(find_intersections(osm, graph)) >= 3
