"""What a car perceives of others: nobody behind a van, and the past where it sees late."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath, FrenetPoint
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.perception import PerceptionFaults, Sight
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from foretwin.sim_worker.road_users.sight_lines import OpaqueGrid
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.vehicle.parameters import load_vehicle

CAR = load_vehicle()
EGO_PATH = FrenetPath(np.array([[0.0, 0.0], [100.0, 0.0]]))
BESIDE = FrenetPath(np.array([[0.0, 3.0], [100.0, 3.0]]))
ACROSS = FrenetPath(np.array([[24.5, 3.5], [24.5, -30.0]]))
VAN = Player("van", "van", BESIDE, 20.0, 0.0, conduct="parked")
WALKER = Player("walker", "pedestrian", ACROSS, 0.0, 1.5, hidden_by="van")
LEAD = Player("lead", "car", EGO_PATH, 40.0, 5.0)


def sight(
    *players: Player,
    beside: tuple[Player, ...] | None = None,
    walls: OpaqueGrid | None = None,
    **faults: float,
) -> tuple[Sight, Traffic]:
    """One future, and another with those `beside`."""
    casts = [players] if beside is None else [players, beside]
    cast = casting(casts, ego_path=EGO_PATH)
    table = PathTable(cast.paths)
    rules = JunctionRules(None).between([()] * len(cast.paths))
    traffic = Traffic(cast.crowd, table, rules, cast.paces)
    columns = {name: np.zeros(len(casts)) for name in PerceptionFaults._fields}
    columns |= {name: np.array([value]) for name, value in faults.items()}
    faulty = PerceptionFaults(**columns)
    eyes = Sight(traffic, table.along(EGO_PATH), CAR, faulty, tick_s=0.05, walls=walls)
    return eyes, traffic


@pytest.mark.parametrize(("eyes_x_m", "seen"), [(0.0, False), (15.0, False), (22.5, True)])
def test_who_stands_behind_a_van_is_seen_only_past_it(eyes_x_m: float, seen: bool) -> None:
    eyes, traffic = sight(VAN, WALKER)
    found = eyes.look(0, traffic, np.array([[eyes_x_m, 0.0]]))
    assert np.isfinite(found.poses[0, 0]).all(), "the van itself is seen"
    assert bool(np.isfinite(found.poses[0, 1]).all()) == seen
    assert found.walks.tolist() == [[False, True]]


WALL = OpaqueGrid(np.ones((4, 60), dtype=np.uint8), -10.0, 2.0, 0.5)
"""A wall of two metres on the left of the road, from 10 m behind its beginning to 20 m."""
DRIVEWAY = FrenetPath(np.array([[24.5, 20.0], [24.5, -30.0]]))


def test_a_wall_hides_whom_the_map_knows_but_not_whom_the_car_perceives() -> None:
    walker = Player("walker", "pedestrian", DRIVEWAY, 0.0, 1.5)
    perceived = walker._replace(name="perceived", known=True)
    eyes, traffic = sight(perceived, walker, walls=WALL)
    found = eyes.look(0, traffic, np.array([[0.0, 0.0]]))
    assert np.isfinite(found.arc_m).tolist() == [[True, False]]
    assert np.isfinite(eyes.look(2, traffic, np.array([[21.0, 0.0]])).arc_m).all()
    eyes, traffic = sight(walker, beside=(perceived,), walls=WALL)
    both = eyes.look(0, traffic, np.zeros((2, 2)))
    assert np.isfinite(both.arc_m).tolist() == [[False], [True]]
    alone, traffic = sight(perceived, walls=WALL)
    assert not alone.needs_eyes


def test_walls_are_looked_at_ten_times_a_second() -> None:
    eyes, traffic = sight(Player("walker", "pedestrian", DRIVEWAY, 0.0, 1.5), walls=WALL)
    far, near = np.array([[0.0, 0.0]]), np.array([[21.0, 0.0]])
    seen = [np.isfinite(eyes.look(k, traffic, at).arc_m).all() for k, at in enumerate((far, near))]
    assert seen == [False, False]
    assert np.isfinite(eyes.look(2, traffic, near).arc_m).all()


def advance(eyes: Sight, traffic: Traffic, ticks: int) -> Array:
    """Return (ticks + 1,) where the first road user is seen along the ego path."""
    arcs = []
    for tick in range(ticks + 1):
        arcs.append(float(eyes.look(tick, traffic, np.zeros((1, 2))).arc_m[0, 0]))
        traffic.step(time_s=tick * 0.05, dt_s=0.05)
    return np.array(arcs)


def test_who_sees_late_sees_the_past() -> None:
    prompt, late = advance(*sight(LEAD), 40), advance(*sight(LEAD, delay_s=0.5), 40)
    assert prompt[-1] == pytest.approx(40.0 + 5.0 * 2.0)
    assert late[10:] == pytest.approx(prompt[:-10])


def test_lost_detections_are_lost_for_their_time() -> None:
    arcs = advance(*sight(LEAD, lost_from_s=0.5, lost_for_s=1.0), 40)
    lost = np.flatnonzero(np.isnan(arcs)) * 0.05
    assert (lost[0], lost[-1]) == pytest.approx((0.5, 1.45))
    assert np.isfinite(arcs[31:]).all()


def test_the_lead_is_who_is_in_the_way_and_nearest() -> None:
    far = LEAD._replace(name="far", start_arc_m=70.0)
    eyes, traffic = sight(far, VAN, LEAD)
    seen = eyes.look(0, traffic, np.zeros((1, 2)))
    lead = eyes.lead(seen, FrenetPoint(np.zeros(1), np.zeros(1)))
    front_m = CAR.length_m.value - CAR.rear_overhang_m.value
    assert lead.gap_m[0] == pytest.approx(40.0 - 2.25 - front_m)
    assert lead.speed_mps[0] == pytest.approx(5.0)
    aside = eyes.lead(seen, FrenetPoint(np.zeros(1), np.array([3.0])))
    assert aside.gap_m[0] == pytest.approx(20.0 - 3.0 - front_m, abs=0.01), "now it is the van"
