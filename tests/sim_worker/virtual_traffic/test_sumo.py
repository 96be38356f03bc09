"""SUMO as virtual traffic: what is wrong is said; its vehicles, where SUMO is there, go on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.virtual_traffic.sumo import SumoTraffic, is_there, net_of
from foretwin.world_gen.export.opendrive import write_opendrive
from tests.sim_worker.places import crossroads
from tests.sim_worker.virtual_traffic.motions import played, still, tracks


def test_a_network_of_sumo_is_taken_as_it_is(tmp_path: Path) -> None:
    net = tmp_path / "a.net.xml"
    assert net_of(net, tmp_path) == net


@pytest.mark.skipif(is_there(), reason="SUMO is there")
def test_without_sumo_one_line_says_what_to_install(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"pip install 'foretwin\[sumo\]'"):
        SumoTraffic(load_vehicle(), tmp_path / "a.net.xml", count=3, seed=1)


@pytest.mark.skipif(not is_there(), reason="needs the extra sumo")
def test_vehicles_drive_on_the_network_of_our_own_export(tmp_path: Path) -> None:
    write_opendrive(crossroads(), tmp_path / "a.xodr")
    traffic = SumoTraffic(load_vehicle(), net_of(tmp_path / "a.xodr", tmp_path), count=4, seed=1)
    try:
        scenes = list(played(traffic, still(20.0, 20.0), from_s=0.0, to_s=20.0))
    finally:
        traffic.close()
    assert scenes[100]
    for track in tracks(scenes).values():
        along = np.abs(np.diff(track.rows[:, 3])) / 0.05
        assert along.max(initial=0.0) <= 7.6
