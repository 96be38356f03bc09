"""Drives that are staged: what is to happen is planned first, then the stand-in car drives it.

The plan is the label. Nothing here is shared with what recognises: ways come from the World's
lanes, times from where the stand-in truly was, and whoever meets it is put there by arithmetic. Of
a drive are kept the car's sensors and noisy detections alone.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.contracts.world import World
from foretwin.geometry.polyline import arc_lengths, left_of, tangents
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.telemetry.known_standin import KnownStandin
from tests.world_gen.drawn_maps import drawn_map, world_of

LANE_M = 3.25
_APPROACH_M, _ONWARD_M = 138.0, 105.0
_STEP_S = 0.1
Random = np.random.Generator


@functools.cache
def stage_world(skew_deg: float, side: str = "right") -> World:
    """Two lanes each way from west to east, one each way from south to north, leaned eastward;
    mirrored from north to south where people drive on the left."""
    mirror = 1.0 if side == "right" else -1.0
    x, y = 260.0 * math.sin(math.radians(skew_deg)), 260.0 * math.cos(math.radians(skew_deg))
    nodes = {0: (0.0, 0.0), 1: (260.0, 0.0), 2: (x, y), 3: (-260.0, 0.0), 4: (-x, -y)}
    nodes = {node: (east, mirror * north) for node, (east, north) in nodes.items()}
    high = {"highway": "secondary", "name": "High Road", "lanes": "4", "maxspeed": "50"}
    low = {"highway": "tertiary", "name": "Side Street", "lanes": "2", "maxspeed": "50"}
    ways = [(11, [0, 1], high), (12, [0, 2], low), (13, [3, 0], high), (14, [4, 0], low)]
    sided = [(way, members, tags | {"driving_side": side}) for way, members, tags in ways]
    return world_of(drawn_map(nodes, sided), radius_m=250.0)


class EgoPlan(NamedTuple):
    """Where the stand-in is to drive: from an arm, by a turn, with what on the way."""

    from_deg: float
    """Where it heads as it comes, counter-clockwise from east."""
    turn: str
    speed_mps: float
    change: str = ""
    """To which side it changes the lane on its approach."""
    stops: bool = False
    """Before the junction."""
    seed: int = 0
    skew_deg: float = 0.0
    """Of the crossing that it drives over."""

    @property
    def world(self) -> World:
        """What it drives through."""
        return stage_world(self.skew_deg)


class Drive(NamedTuple):
    """One drive of the stand-in: its plan, its line (N, 2), its sensors' samples, and where it
    truly was: at `time_s` (K,) of its clock, how far its box's middle was along the line."""

    plan: EgoPlan
    line: Array
    entry_m: float
    exit_m: float
    samples: list
    info: object
    time_s: Array
    arc_m: Array
    speed_mps: Array
    change_at_s: float


class Label(NamedTuple):
    """What is staged: of which kind, with whom ("" for the car itself), when."""

    kind: str
    actor: str
    begin_s: float
    end_s: float


def way_line(world: World, from_deg: float, turn: str) -> tuple[Array, float, float]:
    """Return a line through the junction, and where that begins and ends along it."""
    network = RoadNetwork(world)
    turns = {"straight": "straight", "left": "across", "right": "near"}
    fits = [
        passage
        for passage in network.passages(world.intersection.id)
        if passage.turn == turns[turn]
        and abs(math.remainder(passage.entry_heading_rad - math.radians(from_deg), math.tau)) < 0.3
    ]
    assert fits, (from_deg, turn)
    way = network.way(fits[0])
    begin, end = way.entry_m - _APPROACH_M, way.exit_m + _ONWARD_M
    arcs = np.arange(max(begin, 0.0), min(end, way.path.length_m), 0.5)
    return way.path.point_at(arcs.copy()), way.entry_m - arcs[0], way.exit_m - arcs[0]


def lanes_beside(from_deg: float) -> bool:
    """Whether there are two lanes on the approach."""
    return abs(math.sin(math.radians(from_deg))) < 0.5


def smooth(share: Array) -> Array:
    """Return a smooth step from 0 to 1."""
    held = np.clip(share, 0.0, 1.0)
    return held * held * (3.0 - 2.0 * held)


def moved_aside(line: Array, left_m: Array) -> Array:
    """Return a line moved to its left."""
    return line + left_m[:, None] * left_of(tangents(line))


@functools.cache
def drive(plan: EgoPlan) -> Drive:
    """Let the stand-in drive a plan."""
    line, entry, leave = way_line(plan.world, plan.from_deg, plan.turn)
    arc = arc_lengths(line)
    change_m = 0.0
    if plan.change:
        # It comes in the other lane and changes to that of its way.
        change_m = 55.0
        sign = -1.0 if plan.change == "left" else 1.0
        share = smooth((arc - change_m) / (plan.speed_mps * 4.0))
        line = moved_aside(line, sign * LANE_M * (1.0 - share))
    speed = np.full(len(line), plan.speed_mps)
    if plan.stops:
        stop = int(np.argmin(np.abs(arc - (entry - 5.0))))
        speed[stop : stop + 3] = 0.0
    parameters = read_parameters()
    geo = geo_from_local(plan.world.frame, line)
    path = DrivenPath(geo[:, 0], geo[:, 1], speed, driver=parameters.driver)
    source = KnownStandin(path, parameters, vehicle_id="standin", seed=plan.seed, end_s=60.0)
    samples = []
    length = float(arc_lengths(line)[-1])
    until = source.first_stamp_ns
    while not source.ended and source._driver.s_m < length - 55.0:
        until += 500_000_000
        samples += list(source.advance(until))
    last_s = (samples[-1][1].stamp_ns - START_STAMP_NS) * 1e-9
    time_s = np.arange(0.0, last_s - 0.1, _STEP_S)
    states = [source.truth(START_STAMP_NS + round(t * 1e9)) for t in time_s]
    xy = np.array(
        [local_from_geo(plan.world.frame, s.position.lat_deg, s.position.lon_deg) for s in states]
    )
    middle_m = 1.3
    arcs = _along(line, xy) + middle_m
    truth_mps = np.array([s.speed_mps for s in states])
    change_at = float(np.interp(change_m, arcs, time_s)) if plan.change else math.nan
    return Drive(plan, line, entry, leave, samples, source.info, time_s, arcs, truth_mps, change_at)


def _along(line: Array, xy: Array) -> Array:
    """Return how far along a line points are, never backwards."""
    arc = arc_lengths(line)
    away = np.hypot(*(xy[:, None] - line[None]).transpose(2, 0, 1))
    return np.maximum.accumulate(arc[away.argmin(axis=1)])


def own_labels(staged: Drive, begin_s: float, end_s: float) -> list[Label]:
    """Return what the car itself does, by its plan, as far as it is in the record."""
    plan = staged.plan
    turn = "through_straight" if plan.turn == "straight" else f"turn_{plan.turn}"
    found = [
        Label(
            turn,
            "",
            *np.interp([staged.entry_m, staged.exit_m], staged.arc_m, staged.time_s).tolist(),
        )
    ]
    if plan.change:
        found.append(
            Label(f"lane_change_{plan.change}", "", staged.change_at_s, staged.change_at_s + 4.0)
        )
    if plan.stops:
        stood = staged.time_s[(staged.speed_mps < 0.1) & (staged.time_s > begin_s)]
        found.append(Label("standstill", "", float(stood[0]), float(stood[-1])))
        found.append(Label("stop", "", float(stood[0]) - 3.0, float(stood[0])))
    return [one for one in found if begin_s < one.begin_s and one.end_s < end_s]


def record_span(staged: Drive) -> tuple[float, float]:
    """Return from when to when the drive is recorded: it moves by then, and does not end yet."""
    fast = staged.time_s[staged.speed_mps > 0.8 * staged.plan.speed_mps]
    return float(fast[0]), float(staged.time_s[-1])
