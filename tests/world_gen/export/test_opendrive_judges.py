"""ASAM's checker and SUMO's netconvert judge OpenDRIVE files of sixty real junctions."""

from __future__ import annotations

import ast
import os
import re
import subprocess
from collections import Counter, defaultdict
from pathlib import Path
from typing import NamedTuple

import pytest

from foretwin.contracts.world import World
from foretwin.world_gen.export.opendrive import write_opendrive
from foretwin.world_gen.export.opendrive_one_ways import parted_by_direction
from tests.world_gen.export.judged_sample import sample_worlds
from tests.world_gen.export.read_opendrive import OpenDriveFile

pytestmark = [pytest.mark.judge, pytest.mark.real_data, pytest.mark.timeout(3600)]


class Judgement(NamedTuple):
    issues: int
    imported: bool
    arms: dict[int, int]
    """How many junctions of three and more arms SUMO finds, by their arms."""


@pytest.fixture(scope="module")
def script() -> Path:
    folder = os.environ.get("FORETWIN_JUDGES")
    if not folder:
        pytest.skip("FORETWIN_JUDGES is not set: no judges of exports here")
    path = Path(folder) / "opendrive.sh"
    if not path.exists():
        pytest.skip(f"FORETWIN_JUDGES={folder}: no {path.name} there")
    return path


def judge(script: Path, file: Path) -> Judgement:
    run = subprocess.run(
        ["bash", script, file], capture_output=True, text=True, timeout=600, check=False
    )
    issues = re.search(r"asam-qc: .*issues (\d+)", run.stdout)
    found = re.search(r"netconvert: rc (\d+) .*arms: (\d+) ?(\{.*\})?", run.stdout)
    assert issues, run.stdout + run.stderr
    assert found, run.stdout + run.stderr
    assert 'status="completed"' in run.stdout
    return Judgement(int(issues[1]), found[1] == "0", ast.literal_eval(found[3] or "{}"))


def arms_of(world: World, file: Path) -> dict[int, int]:
    """Return how many places have how many arms, where they have three and more.

    Told from the World's roads: an arm of a place is another place, or a free end at the World's
    edge, to which a road leads from it. Two roads between the same two places are thus one arm,
    which is how the judge counts in SUMO's network. A place of two roads through which no lane
    leads is the World's edge. Only of the file it is asked at which places a short road bridges
    the gap between two roads: SUMO has a node at each of its ends.
    """
    roads = [road for road in world.roads if road.lane_ids]
    ends = Counter(end for road in roads for end in (road.from_place, road.to_place))
    through = {c.place_id for c in world.connections}
    road_of = {lane: road for road in roads for lane in road.lane_ids}
    for lane in world.lanes:
        for following in lane.successor_ids:
            if following in road_of and lane.id in road_of:
                a, b = road_of[lane.id], road_of[following]
                through |= {a.from_place, a.to_place} & {b.from_place, b.to_place}
    bridged = {road.source for road in OpenDriveFile.read(file).roads.values()}
    parted = {None} | {p for p in ends if p in bridged or (p not in through and ends[p] < 3)}
    beside: defaultdict[object, set[object]] = defaultdict(set)
    for road in roads:
        start, end = (
            (road.id, at) if place in parted else place
            for at, place in (("start", road.from_place), ("end", road.to_place))
        )
        beside[start].add(end)
        beside[end].add(start)
    return dict(Counter(len(others) for others in beside.values() if len(others) >= 3))


def test_judges_find_no_fault_and_the_world_s_own_junctions(
    script: Path, data_dir: Path, tmp_path: Path
) -> None:
    failures = []
    count = 0
    for name, world in sample_worlds(data_dir):
        file = tmp_path / f"{name}.xodr"
        write_opendrive(world, file)
        found = judge(script, file)
        count += 1
        arms = arms_of(world, file)
        if found != Judgement(0, True, arms):
            failures.append(f"{name}: {found}, the World has {arms}")
    assert count == 60
    assert not failures, "\n".join(failures)


def test_judges_read_version_1_4_too(script: Path, data_dir: Path, tmp_path: Path) -> None:
    seen = set()
    for name, world in sample_worlds(data_dir):
        extract = name.rpartition("-")[0]
        if extract in seen:
            continue
        seen.add(extract)
        file = tmp_path / f"{name}.xodr"
        write_opendrive(world, file, version="1.4")
        left = world.intersection.driving_side == "left"
        as_written = parted_by_direction(world) if left else world
        assert judge(script, file) == Judgement(0, True, arms_of(as_written, file)), name
    assert len(seen) == 7
