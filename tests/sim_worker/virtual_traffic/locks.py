"""`python -m tests.sim_worker.virtual_traffic.locks [--count N] [--seeds N]`: how traffic gets on.

In four junctions of the drawn town, a roundabout, one with a stop sign, one with lights and one
that gives way, beside a car that stays 6 m beside a road: prints for each run how many metres all
drive in a minute, how many have stood for a minute at the end, and how many pairs have touched.
"""

from __future__ import annotations

import argparse
import itertools
from collections import defaultdict

import numpy as np

import foretwin
from foretwin.contracts.world import World
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.model import ModelTraffic
from foretwin.sim_worker.virtual_traffic.source import STEP_S, VirtualUser
from foretwin.world_gen.rules.signal_state import colours_at

JUNCTIONS = ("n11", "n4", "n44", "n57")
_BEFORE_M, _ASIDE_M = 30.0, 6.0
_STANDS_S, _STANDING_MPS = 60.0, 0.3


def main() -> None:
    """Run it, and print what came of it."""
    parser = argparse.ArgumentParser(prog="python -m tests.sim_worker.virtual_traffic.locks")
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=240.0)
    asked = parser.parse_args()
    town, runs = foretwin.drawn_town(), []
    for junction, seed in itertools.product(JUNCTIONS, range(1, asked.seeds + 1)):
        found = measured(town.world(junction), asked.count, seed, asked.seconds)
        runs.append(found)
        print(
            f"{junction:4} seed {seed}: {found[0]:5.0f} m/min, {found[1]} stand, {found[2]} touch"
        )
    metres, stand, touch = np.array(runs).T
    locked = int((stand >= 0.75 * asked.count).sum())
    print(f"{locked} of {len(runs)} locked, {metres.mean():.0f} m/min, {touch.sum():.0f} touch")


def measured(world: World, count: int, seed: int, seconds: float) -> tuple[float, int, int]:
    """Return metres a minute of all, who stands in the end, and the pairs that have touched."""
    traffic = ModelTraffic(load_vehicle(), count=count, seed=seed)
    traffic.use_world(world)
    car, made_m = beside(world), 0.0
    plans = [one.plan for one in world.junctions if one.plan is not None]
    stood_s: dict[str, float] = defaultdict(float)
    touched: set[tuple[str, str]] = set()
    users: tuple[VirtualUser, ...] = ()
    for k in range(round(seconds / STEP_S)):
        colours = {}
        for plan in (*plans, *world.crossing_plans):
            colours.update(colours_at(plan, k * STEP_S, {}))
        users = traffic.step(car, time_s=k * STEP_S, colours=colours)
        made_m += sum(one.speed_mps for one in users) * STEP_S
        for one in users:
            stands = one.speed_mps < _STANDING_MPS
            stood_s[one.user_id] = stood_s[one.user_id] + STEP_S if stands else 0.0
        touched |= touching(users)
    still = sum(stood_s[one.user_id] > _STANDS_S for one in users)
    return made_m / seconds * 60.0, still, len(touched)


def beside(world: World) -> np.ndarray:
    """Return a car that stands on the right of the road that leads to the first connection."""
    first = world.connections[0]
    (line,) = (one.centerline for one in world.lanes if one.id == first.from_lane_id)
    yaw = float(np.arctan2(*(line[-1] - line[-2])[::-1]))
    ahead, right = (np.cos(yaw), np.sin(yaw)), (np.sin(yaw), -np.cos(yaw))
    row = np.zeros(8)
    row[:2] = line[-1] - _BEFORE_M * np.array(ahead) + _ASIDE_M * np.array(right)
    row[2] = yaw
    return row


def touching(users: tuple[VirtualUser, ...]) -> set[tuple[str, str]]:
    """Return the names of pairs that touch."""
    rows = np.array([(one.x_m, one.y_m, one.yaw_rad, one.length_m, one.width_m) for one in users])
    one, other = np.triu_indices(len(users), 1)
    a, b = (Rectangles(rows[k, :2], *rows[k, 2:].T) for k in (one, other))
    hits = np.flatnonzero(overlapping(a, b)).tolist()
    return {(users[one[hit]].user_id, users[other[hit]].user_id) for hit in hits}


if __name__ == "__main__":
    main()
