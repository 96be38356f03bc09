"""What the Lanelet2 library says of maps: it loads them whole and finds every route, no other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.world import Conflict, Connection, World
from foretwin.world_gen.export.lane_borders import lane_borders
from foretwin.world_gen.export.lanelet2 import write_lanelet2
from tests.world_gen.drawn_maps import roundabout, world_of
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.judges import ask_judge, judges_python
from tests.world_gen.export.signalled import signalled_crossing


def routes_asked(drawn: World, path: Path) -> dict[str, Any]:
    borders = lane_borders(drawn)
    lanes = {lane.id for lane in drawn.lanes}
    return {
        "path": str(path),
        "lat": drawn.frame.origin.lat_deg,
        "lon": drawn.frame.origin.lon_deg,
        "connections": [[c.id, c.from_lane_id, c.to_lane_id] for c in drawn.connections],
        "successions": [[a.id, b] for a in drawn.lanes for b in a.successor_ids if b in lanes],
        "waits": [[c.yields_id, _other(c)] for c in drawn.conflicts if not _all_stop(drawn, c)],
        "lights": [[c.id, c.signal_group_id] for c in drawn.connections if _lit(drawn, c)],
        "positions": [[lane.id, *borders[lane.id].left[0].tolist()] for lane in drawn.lanes],
    }


def _other(conflict: Conflict) -> str:
    return conflict.second_id if conflict.yields_id == conflict.first_id else conflict.first_id


def _all_stop(drawn: World, conflict: Conflict) -> bool:
    """Return whether the two meet where all stop, and go in order of arrival."""
    junction_of = {c.id: c.junction_id for c in drawn.connections}
    stops = {j.summary.id for j in drawn.junctions if j.summary.control == "all_way_stop"}
    return junction_of[conflict.yields_id] in stops


def _lit(drawn: World, connection: Connection) -> bool:
    """Return whether a head of the connection's group stands at its lane."""
    return any(
        head.group_id == connection.signal_group_id and connection.from_lane_id in head.lane_ids
        for head in drawn.signals
    )


def assert_accepted(tasks: list[dict[str, Any]], worlds: list[World]) -> None:
    verdicts = ask_judge("load_lanelet2.py", tasks)
    for task, drawn in zip(tasks, worlds, strict=True):
        verdict = verdicts[task["path"]]
        assert verdict["errors"] == []
        assert verdict["missing_routes"] == []
        assert verdict["stray_routes"] == []
        assert verdict["graph_faults"] == []
        assert verdict["other_waits"] == []
        assert verdict["other_lights"] == []
        assert verdict["off_m"] < 0.01
        roads = sum(n for kind, n in verdict["lanelets"].items() if kind != "crosswalk")
        assert roads == len(drawn.lanes) + len(drawn.connections)
        assert verdict["lanelets"].get("crosswalk", 0) == len(drawn.crossings)
        for lane in drawn.lanes:
            if lane.kind == "driving":
                kmh = round(lane.speed_limit_mps.value * 3.6)
                assert verdict["speeds"][lane.id] == pytest.approx(kmh, abs=0.01)


@pytest.mark.judge
def test_lanelet2_loads_drawn_worlds(tmp_path: Path) -> None:
    judges_python()
    worlds = [signalled_crossing(), world_of(roundabout())]
    tasks = []
    for i, drawn in enumerate(worlds):
        path = tmp_path / f"{i}.osm"
        write_lanelet2(drawn, path)
        tasks.append(routes_asked(drawn, path))
    assert_accepted(tasks, worlds)


@pytest.mark.judge
@pytest.mark.real_data
def test_lanelet2_loads_the_sampled_worlds_with_every_route(data_dir: Path, tmp_path: Path) -> None:
    judges_python()
    tasks, worlds = [], []
    for sampled in sample_worlds(data_dir):
        path = tmp_path / f"{sampled.name}.osm"
        write_lanelet2(sampled.world, path)
        tasks.append(routes_asked(sampled.world, path))
        worlds.append(sampled.world)
    assert len(worlds) == 60
    assert_accepted(tasks, worlds)
