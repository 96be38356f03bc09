"""The answer to where scenarios take place in a World, or around a car that was recorded there."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.contracts.placement import AS_RECORDED, PlaceRequest, RecordedStart
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.futures.world_places import places_in
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import state_at
from tests.sim_worker.scenarios.worlds import cross

CAR = load_vehicle()
WORLD = cross()


def test_places_and_ways_are_those_of_the_placement_and_others_say_why_not() -> None:
    asked = PlaceRequest(
        world_id=WORLD.id,
        scenarios=(catalogue()["scp"], catalogue()["roundabout_entry"]),
        vehicle="",
        most=2,
    )
    found = places_in(WORLD, asked, CAR)
    wanted = places(catalogue()["scp"], WORLD, vehicle=CAR, most=2).places
    assert [(one.scenario_id, one.place) for one in found.placed] == [
        ("scp", place.name) for place in wanted
    ]
    assert {one.ego for one in found.placed} == set(found.ways)
    np.testing.assert_array_equal(found.ways[wanted[0].ego.name].xy_m, wanted[0].ego.xy_m)
    (why,) = found.unplaced
    assert why.scenario_id == "roundabout_entry"
    assert not why.applies
    assert why.reason


def test_around_a_recorded_car_what_fits_its_way_is_numbered() -> None:
    ego = places(catalogue()["scp"], WORLD, vehicle=CAR, most=1).places[0].ego
    way = ego.path.point_at(np.arange(0.0, ego.exit_m + 30.0, 2.0))
    lat, lon = geo_from_local(WORLD.frame, way).T
    begins = ego.path.point_at(np.array([ego.entry_m - 40.0]))[0]
    here = GeoPoint(*geo_from_local(WORLD.frame, begins).tolist())
    start = RecordedStart(
        round_id=7,
        drive_time_s=0.0,
        world_id=WORLD.id,
        junction_id="n0",
        cruise_speed_mps=8.0,
        state=msgspec.structs.replace(state_at(0.0, 0.0), position=here),
        lat_deg=tuple(lat.tolist()),
        lon_deg=tuple(lon.tolist()),
    )
    recorded = catalogue()["scp"]
    asked = PlaceRequest(
        world_id=WORLD.id,
        scenarios=(
            recorded,
            type(recorded)(id=AS_RECORDED, title="as it was", shows="the same", source="here"),
            catalogue()["roundabout_entry"],
        ),
        vehicle="",
        most=2,
        starts=((3, start),),
    )
    found = places_in(WORLD, asked, CAR)
    crossing = [one for one in found.placed if one.scenario_id == "scp"]
    assert [one.rank for one in crossing] == list(range(len(crossing)))
    assert all(one.start == 3 and one.place.startswith("round 7: ") for one in crossing)
    assert crossing
    (same,) = (one for one in found.placed if one.scenario_id == AS_RECORDED)
    assert (same.place, same.ego, same.start) == ("round 7", "round 7", 3)
    (why,) = found.unplaced
    assert why.reason == "round 7: does not apply on the recorded way"


def test_where_no_recorded_car_began_nothing_is_as_recorded() -> None:
    scenario = catalogue()["scp"]
    as_it_was = type(scenario)(id=AS_RECORDED, title="as it was", shows="it", source="here")
    asked = PlaceRequest(world_id=WORLD.id, scenarios=(as_it_was,), vehicle="", most=1)
    found = places_in(WORLD, asked, CAR)
    assert (found.placed, found.unplaced) == ((), ())
