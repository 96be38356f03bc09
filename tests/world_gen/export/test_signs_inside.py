"""The sign of a slip road in every export: on the connection, where the World has its line."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from foretwin.contracts.world import Connection, StopLine, World
from foretwin.world_gen.export.commonroad import write_commonroad
from foretwin.world_gen.export.geojson import write_geojson
from foretwin.world_gen.export.picture_style import View
from foretwin.world_gen.export.picture_traffic import draw_traffic
from foretwin.world_gen.export.sdformat import write_sdf
from foretwin.world_gen.report.report import report_of
from tests.world_gen.export.lanelet2_file import written as written_lanelet2
from tests.world_gen.export.test_opendrive import check_closed
from tests.world_gen.export.test_opendrive import written as written_opendrive
from tests.world_gen.slip_roads import lines_inside, slip_world


@pytest.fixture(scope="module", params=[False, True], ids=["right-hand", "left-hand"])
def world(request: pytest.FixtureRequest) -> World:
    return slip_world(left_hand=request.param)


@pytest.fixture(scope="module")
def signed(world: World) -> tuple[StopLine, Connection]:
    (found,) = lines_inside(world)
    return found


def test_opendrive_has_sign_and_paint_on_the_connecting_road(world, signed, tmp_path: Path) -> None:
    line, slip = signed
    file = written_opendrive(world, tmp_path)
    check_closed(file)
    (sign,) = [s for s in file.root.iter("signal") if s.get("name") == line.id]
    road = next(road for road in file.roads.values() if road.source == slip.id)
    assert sign.getparent().getparent() is road.element
    assert (sign.get("type"), sign.get("orientation"), sign.get("dynamic")) == ("205", "+", "no")
    ((number, _),) = road.lanes.items()
    valid = sign.find("validity")
    assert {valid.get("fromLane"), valid.get("toLane")} == {str(number)}
    # 0.6 m beside the end of the line at the kerb, and facing who drives there.
    kerb, across = (1, 0) if world.intersection.driving_side == "right" else (0, 1)
    outward = line.ends[kerb] - line.ends[across]
    place = line.ends[kerb] + 0.6 * outward / np.hypot(*outward)
    at = road.beside(float(sign.get("s")), float(sign.get("t")))
    assert at == pytest.approx(place, abs=0.02)
    assert abs(float(sign.get("hOffset"))) < 0.15
    (paint,) = [o for o in file.root.iter("object") if o.get("name") == line.id]
    assert paint.getparent().getparent() is road.element


def test_lanelet2_lets_the_slip_road_wait_at_its_own_line(world, signed, tmp_path: Path) -> None:
    line, slip = signed
    found = written_lanelet2(world, tmp_path)
    mine = [
        {role: ref for _, ref, role in members}
        for _, members, _ in found.rules("right_of_way")
        if ("relation", found.id_of(slip.id), "yield") in members
    ]
    assert len(mine) == 1
    nodes, tags = found.ways[mine[0]["ref_line"]]
    assert tags["type"] == "yield_line"
    places = [[float(found.nodes[n][key]) for key in ("local_x", "local_y")] for n in nodes]
    assert places == pytest.approx(line.ends, abs=0.002)


def test_commonroad_has_stop_line_and_sign_on_the_connection(world, signed, tmp_path: Path) -> None:
    line, slip = signed
    write_commonroad(world, tmp_path / "map.xml", date=datetime.date(2025, 6, 1))
    root = etree.parse(str(tmp_path / "map.xml")).getroot()
    lanelet = root.findall("lanelet")[len(world.lanes) + world.connections.index(slip)]
    stop = lanelet.find("stopLine")
    assert stop.findtext("lineMarking") == "broad_dashed"
    places = [[float(p.findtext(axis)) for axis in "xy"] for p in stop.findall("point")]
    assert places == pytest.approx(line.ends, abs=0.002)
    signs = {s.get("id"): s for s in root.iterfind("trafficSign")}
    named = [signs[ref.get("ref")] for ref in lanelet.iterfind("trafficSignRef")]
    assert "205" in {s.findtext("trafficSignElement/trafficSignID") for s in named}
    # No other lanelet has a sign to give way.
    others = [s for s in signs.values() if s.findtext("trafficSignElement/trafficSignID") == "205"]
    assert len(others) == 1


def test_geojson_and_sdformat_have_the_line(world, signed, tmp_path: Path) -> None:
    line, slip = signed
    write_geojson(world, tmp_path / "world.geojson")
    features = json.loads((tmp_path / "world.geojson").read_text(encoding="utf-8"))["features"]
    lines = [f["properties"] for f in features if f["properties"]["kind"] == "stop_line"]
    (told,) = [line for line in lines if line["connection_id"] == slip.id]
    assert (told["control"], told["control_source"]) == ("give_way", "tagged")
    write_sdf(world, tmp_path / "world.sdf")
    root = etree.parse(str(tmp_path / "world.sdf")).getroot()
    painted = root.findall("world/model[@name='markings']/link/visual")
    middle = line.ends.mean(axis=0)
    places = [[float(v) for v in part.findtext("pose").split()[:2]] for part in painted]
    assert min(np.hypot(*(np.array(at) - middle)) for at in places) < 0.002


def test_picture_and_report_tell_of_the_sign(world, signed) -> None:
    line, _ = signed
    axes = Figure().add_subplot()
    view = View(west_m=-90.0, south_m=-90.0, east_m=90.0, north_m=90.0, close=True)
    draw_traffic(axes, world, view)
    drawn = [c.get_segments() for c in axes.collections if isinstance(c, LineCollection)]
    assert any(np.array_equal(part, line.ends) for parts in drawn for part in parts)
    # Of all marks of who waits by a sign there is one, right before the line.
    (mark,) = [item for item in axes.lines if item.get_marker() == "v"]
    assert np.hypot(*(mark.get_xydata()[0] - line.ends.mean(axis=0))) == pytest.approx(1.6)
    (junction,) = report_of(world).junctions
    control = next(s for s in junction.subjects if s.subject == "control")
    assert control.tagged == len(world.stop_lines)
