"""Lanes and turns lie where the car drove, where it is clear which they were, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
import shapely

from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.tracks import DrivenTrack, TrackSet
from foretwin.world_gen.driven.passes import passes_within
from foretwin.world_gen.export.formats import FORMATS, ExportOptions
from foretwin.world_gen.extent import Disc
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.report.report import report_of
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.world_store import WorldStore, cached_build
from tests.world_gen.driven.drives import FRAME, crossing, height_at, moved, street, track, world_of

COVERS = ("foretwin.world_gen.driven.passes",)


def line(*points: tuple[float, float]) -> np.ndarray:
    return np.array(points)


def test_a_street_moves_to_where_it_was_driven(tmp_path: Path) -> None:
    before = world_of(street(), tmp_path)
    lane_m = height_at(before, ".f0", 0.0)

    after = world_of(street(), tmp_path, track(line((-290.0, lane_m + 0.9), (290.0, lane_m + 0.9))))

    assert height_at(after, ".f0", 0.0) == pytest.approx(lane_m + 0.9, abs=0.05)
    assert height_at(after, ".b0", 0.0) - height_at(before, ".b0", 0.0) == pytest.approx(
        0.9, abs=0.05
    )
    assert {lane.position_source for lane in after.lanes} == {"driven"}
    assert "1 roads and 0 ways through junctions lie where the car's own passes were" in after.notes


def test_a_street_of_several_lanes_stays_where_the_lane_is_not_clear(tmp_path: Path) -> None:
    tags = {"oneway": "yes", "lanes": "2"}
    before = world_of(street(**tags), tmp_path)
    left_m, right_m = height_at(before, ".f0", 0.0), height_at(before, ".f1", 0.0)
    between_m = 0.6 * right_m + 0.4 * left_m

    unclear = world_of(street(**tags), tmp_path, track(line((-60.0, between_m), (60.0, between_m))))
    clear = world_of(
        street(**tags), tmp_path, track(line((-290.0, right_m + 0.5), (290.0, right_m + 0.5)))
    )

    assert unclear.id == before.id
    assert height_at(clear, ".f1", 0.0) == pytest.approx(right_m + 0.5, abs=0.05)


@pytest.mark.parametrize(
    ("ends", "why"),
    [
        (((-290.0, 7.0), (290.0, 7.0)), "too far off"),
        (((-40.0, -40.0), (40.0, 40.0)), "aslant across it"),
        (((-5.0, -1.0), (5.0, -1.0)), "too short to tell a lane"),
        (((-290.0, 900.0), (290.0, 900.0)), "beyond the World"),
    ],
)
def test_what_tells_nothing_of_a_street_changes_no_byte(
    ends: tuple[tuple[float, float], ...], why: str, tmp_path: Path
) -> None:
    assert world_of(street(), tmp_path, track(line(*ends))).id == world_of(street(), tmp_path).id, (
        why
    )


def test_without_tracks_no_field_tells_of_them(tmp_path: Path) -> None:
    world = world_of(crossing(), tmp_path)

    assert all(lane.position_source is msgspec.UNSET for lane in world.lanes)
    assert b"position_source" not in msgspec.msgpack.encode(world.lanes[0], enc_hook=str)


def test_a_shift_fades_where_nobody_drove(tmp_path: Path) -> None:
    lane_m = height_at(world_of(street(), tmp_path), ".f0", 0.0)

    after = world_of(street(), tmp_path, track(line((-290.0, lane_m + 0.9), (-50.0, lane_m + 0.9))))

    shifts = [height_at(after, ".f0", x) - lane_m for x in (-150.0, 0.0, 60.0, 250.0)]
    assert shifts == sorted(shifts, reverse=True)
    assert shifts[0] == pytest.approx(0.9, abs=0.05)
    assert abs(shifts[-1]) < 0.03


def test_glitches_of_single_fixes_move_nothing_far(tmp_path: Path) -> None:
    lane_m = height_at(world_of(street(), tmp_path), ".f0", 0.0)
    x = np.arange(-290.0, 290.0)
    y = np.full(len(x), lane_m + 0.3)
    y[::40] += 1.8

    after = world_of(street(), tmp_path, track(np.stack([x, y], axis=1)))

    found = [height_at(after, ".f0", x_m) - lane_m for x_m in np.arange(-250.0, 250.0, 5.0)]
    assert np.abs(np.array(found) - 0.3).max() < 0.25


def test_one_swerve_around_a_van_counts_less_than_two_straight_passes(tmp_path: Path) -> None:
    lane_m = height_at(world_of(street(), tmp_path), ".f0", 0.0)
    x = np.arange(-290.0, 290.0)
    swerve = np.stack([x, lane_m + 2.5 * np.exp(-((x / 20.0) ** 4))], axis=1)
    straight = (track(line((-290.0, lane_m + i / 100), (290.0, lane_m))) for i in (0, 1))

    after = world_of(street(), tmp_path, *straight, track(swerve))

    assert abs(height_at(after, ".f0", 0.0) - lane_m) < 0.5


def test_who_was_not_seen_for_a_while_is_two_passes() -> None:
    x = np.concatenate([np.arange(-290.0, -150.0), np.arange(0.0, 290.0)])
    geo = geo_from_local(FRAME, np.stack([x, np.zeros(len(x))], axis=1))
    one = msgspec.structs.replace(
        track(line((0.0, 0.0), (len(x), 0.0))), lat_deg=geo[:, 0], lon_deg=geo[:, 1]
    )

    first, second = passes_within([one], FRAME, Disc(400.0))

    assert first.xy_m[-1, 0] < -150.0
    assert second.xy_m[0, 0] > -1.0


def test_a_cached_world_is_that_of_its_tracks(tmp_path: Path) -> None:
    osm = crossing().read(tmp_path)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    plain = index_map(osm, graph, junctions)
    driven = index_map(osm, graph, junctions, tracks=TrackSet.of(both_ways(1.9)))
    store = WorldStore(tmp_path / "cache")

    built = [cached_build(store, index, junctions[0]) for index in (plain, driven, plain, driven)]

    assert [one.cached for one in built] == [False, False, True, True]
    assert built[0].world.id == built[2].world.id != built[1].world.id == built[3].world.id


def test_a_turn_follows_the_pass_and_stays_joined_to_its_lanes(tmp_path: Path) -> None:
    before = world_of(crossing(), tmp_path)
    turn = next(c for c in before.connections if c.turn == "left")
    lanes = {lane.id: lane.centerline for lane in before.lanes}
    drawn = moved(
        before, np.concatenate([lanes[turn.from_lane_id], turn.centerline, lanes[turn.to_lane_id]])
    )
    middle = len(lanes[turn.from_lane_id]) + len(turn.centerline) // 2
    inward = drawn[middle - 3] + drawn[middle + 3] - 2.0 * drawn[middle]
    away_m = np.hypot(*(drawn - drawn[middle]).T)
    bulge = 0.4 * np.exp(-((away_m / 5.0) ** 2))
    driven = drawn + bulge[:, None] * inward / np.hypot(*inward)

    after = world_of(crossing(), tmp_path, track(driven))
    found = next(c for c in after.connections if c.id == turn.id)

    assert found.path_source == "driven"
    rough = msgspec.structs.replace(track(driven), position_std_m=1.5)
    beside = next(c for c in world_of(crossing(), tmp_path, rough).connections if c.id == turn.id)
    assert beside.path_source is msgspec.UNSET
    path = shapely.LineString(moved(after, found.centerline))
    seen = drawn[middle] + 0.4 * inward / np.hypot(*inward)
    assert path.distance(shapely.Point(seen)) < 0.1
    ends = {lane.id: lane.centerline for lane in after.lanes}
    assert np.array_equal(found.centerline[0], ends[found.from_lane_id][-1])
    assert np.array_equal(found.centerline[-1], ends[found.to_lane_id][0])


def test_a_rough_pass_moves_a_street_less_than_a_good_one(tmp_path: Path) -> None:
    lane_m = height_at(world_of(street(), tmp_path), ".f0", 0.0)
    good = track(line((-290.0, lane_m + 0.9), (290.0, lane_m + 0.9)))
    rough = msgspec.structs.replace(good, position_std_m=2.0)

    shift_m = height_at(world_of(street(), tmp_path, rough), ".f0", 0.0) - lane_m

    assert 0.0 < shift_m < 0.5


def both_ways(y_m: float) -> tuple[DrivenTrack, DrivenTrack]:
    """Drives in both directions, each so far right of the middle of the street."""
    there = track(line((-290.0, -y_m), (290.0, -y_m)))
    return there, track(line((290.0, y_m), (-290.0, y_m)))


@pytest.mark.parametrize("wider", [0.85, 1.15])
def test_lanes_are_as_wide_as_they_are_driven_apart(wider: float, tmp_path: Path) -> None:
    before = world_of(street(), tmp_path)
    middle_m = abs(height_at(before, ".f0", 0.0))

    after = world_of(street(), tmp_path, *both_ways(wider * middle_m))

    for label, side in ((".f0", -1.0), (".b0", 1.0)):
        assert height_at(after, label, 0.0) == pytest.approx(side * wider * middle_m, abs=0.06)
    assert {lane.width_m.source for lane in after.lanes} == {"driven"}
    assert "lanes of 1 roads are as wide as passes were apart" in after.notes
    assert after.lanes[0].width_m.value == pytest.approx(
        wider * before.lanes[0].width_m.value, rel=0.04
    )


def test_a_corrected_world_is_written_in_every_form_and_reported(tmp_path: Path) -> None:
    world = world_of(crossing(), tmp_path, *both_ways(1.9), ground=True)

    for name, form in FORMATS.items():
        out = tmp_path / f"{name}{form.suffix}"
        form.write(world, out, ExportOptions())
        assert out.stat().st_size > 1000
    widths = next(s for s in report_of(world).junctions[0].subjects if s.subject == "lane widths")
    assert widths.driven == 4
    assert not any("Long Street" in text for text in widths.guessed)


def test_a_tagged_width_is_kept_whatever_was_driven(tmp_path: Path) -> None:
    tags = {"width:lanes:forward": "3.1", "width:lanes:backward": "3.1", "lanes": "2"}
    before = world_of(street(**tags), tmp_path)

    after = world_of(street(**tags), tmp_path, *both_ways(1.9))

    assert [lane.width_m for lane in after.lanes] == [lane.width_m for lane in before.lanes]
    assert {lane.width_m.source for lane in after.lanes} == {"tagged"}


def test_one_direction_alone_tells_no_width(tmp_path: Path) -> None:
    after = world_of(street(), tmp_path, both_ways(1.9)[0])

    assert {lane.width_m.source for lane in after.lanes} == {"default"}


def test_the_order_in_which_tracks_are_given_changes_no_byte(tmp_path: Path) -> None:
    lane_m = height_at(world_of(street(), tmp_path), ".f0", 0.0)
    one = track(line((-290.0, lane_m + 0.9), (290.0, lane_m + 0.9)))
    two = track(line((-290.0, lane_m + 0.5), (290.0, lane_m + 0.5)))

    both = world_of(street(), tmp_path, one, two)

    assert both.id == world_of(street(), tmp_path, two, one).id
    assert height_at(both, ".f0", 0.0) == pytest.approx(lane_m + 0.7, abs=0.1)
