"""`foretwin anchor`: a pose on a lane, ready to be the World of an anchor file."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.anchor import AnchorPose
from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.orchestrator.commands.anchor import lane_poses
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.orchestrator.worlds.choice import choose_junctions
from foretwin.world_gen.build import build_world

PLACE = (45.0, -30.0011415)


def test_the_first_is_a_table_of_an_anchor_file(capsys: pytest.CaptureFixture[str]):
    near = f"{PLACE[0]},{PLACE[1]}"
    assert run(["anchor", str(MAP_FILE), "--at", near, "--before", "30"]) == 0
    said = capsys.readouterr().out
    (name,) = tomllib.loads(said)
    assert name == "world"
    pose = AnchorPose(**tomllib.loads(said)["world"])
    pose.validate()
    frame = AnchorPose(lat_deg=PLACE[0], lon_deg=PLACE[1], yaw_deg=0.0).frame
    assert np.hypot(*local_from_geo(frame, pose.lat_deg, pose.lon_deg)) < 100.0
    assert "# [world]" in said


@pytest.mark.parametrize("before_m", [0.0, 20.0, 900.0])
def test_poses_lie_on_their_lanes_and_look_along_them(before_m: float):
    opened, (junction, *_) = choose_junctions(Path(MAP_FILE), at=f"{PLACE[0]},{PLACE[1]}")
    world = build_world(opened.osm, opened.graph, junction)
    found = lane_poses(world, PLACE, before_m=before_m)
    assert found
    assert [one.off_m for one in found] == sorted(one.off_m for one in found)
    for one in found:
        line = np.asarray(one.lane.centerline)[:, :2]
        at = one.pose.position
        xy_m = local_from_geo(world.frame, at.lat_deg, at.lon_deg)
        length_m = float(np.hypot(*np.diff(line, axis=0).T).sum())
        assert one.before_m == pytest.approx(min(before_m, length_m), abs=1e-6)
        if before_m in (0.0, 900.0):
            end, other = (line[-1], line[-2]) if before_m == 0.0 else (line[1], line[0])
            assert xy_m == pytest.approx(line[-1] if before_m == 0.0 else line[0], abs=1e-3)
            along = end - other
            looks = np.array([np.cos(one.pose.yaw_rad), np.sin(one.pose.yaw_rad)])
            assert float(looks @ along) / np.hypot(*along) > 0.99


LANE = "w10012.41.44.f1"
"""Of Lime Street, to the east; the left one of two that end at Harbour Road."""


def test_a_lane_is_named_by_its_id(capsys: pytest.CaptureFixture[str]):
    assert run(["anchor", str(MAP_FILE), "--lane", LANE, "--before", "30"]) == 0
    said = capsys.readouterr().out
    assert f"Lime Street East, {LANE}\n[world]" in said
    assert said.count("[world]") == 1
    pose = AnchorPose(**tomllib.loads(said)["world"])
    assert pose.yaw_deg == pytest.approx(0.0, abs=1.0)
    opened, (junction, *_) = choose_junctions(Path(MAP_FILE), junction_id="n44")
    world = build_world(opened.osm, opened.graph, junction)
    (lane,) = (one for one in world.lanes if one.id == LANE)
    end_deg = geo_from_local(world.frame, np.asarray(lane.centerline)[-1:, :2])[0].tolist()
    here = AnchorPose(lat_deg=pose.lat_deg, lon_deg=pose.lon_deg, yaw_deg=0.0).frame
    assert local_from_geo(here, *end_deg) == pytest.approx((30.0, 0.0), abs=0.1)


def test_a_lane_against_its_way_ends_where_the_way_begins(capsys: pytest.CaptureFixture[str]):
    against = "w10012.41.44.b0"
    assert run(["anchor", str(MAP_FILE), "--lane", against, "--json"]) == 0
    (pose,) = json.loads(capsys.readouterr().out)["poses"]
    assert (pose["lane_id"], pose["lane"]) == (against, "Lime Street")
    assert abs(pose["world"]["yaw_deg"]) == pytest.approx(180.0, abs=1.0)


def test_the_lanes_of_a_junction_are_told_by_id(capsys: pytest.CaptureFixture[str]):
    near = f"{PLACE[0]},{PLACE[1]}"
    run(["anchor", str(MAP_FILE), "--at", near, "--json"])
    ids = [one["lane_id"] for one in json.loads(capsys.readouterr().out)["poses"]]
    assert "w10005.6.19.f0" in ids
    run(["anchor", str(MAP_FILE), "--at", near])
    said = capsys.readouterr().out
    assert all(f", {one}\n" in said for one in ids)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "either --at LAT,LON or --lane ID"),
        (("--at", "45.0,-30.0", "--lane", LANE), "either --at LAT,LON or --lane ID"),
        (("--lane", "Lime Street"), "as w10012.41.44.f0"),
        (("--lane", "w10012.41.44.f7"), f"of n44 holds no such lane; did you mean {LANE}?"),
        (("--lane", "w1.2.99999.f0"), "holds no node 99999"),
        (("--lane", "w1.99999.2.b0"), "holds no node 99999"),
    ],
)
def test_a_lane_that_is_none_is_told_in_a_line(
    words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
):
    assert run(["anchor", str(MAP_FILE), *words]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


def test_what_cannot_be_meant_is_refused(capsys: pytest.CaptureFixture[str]):
    assert run(["anchor", str(MAP_FILE), "--at", "45.0,-30.0", "--before", "-1"]) == 2
    assert "--before" in capsys.readouterr().err
