"""The first drive that a newcomer sees: a stand-in car without faults through the drawn town."""

from __future__ import annotations

import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.orchestrator.routing.standin_path import standin_path
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.orchestrator.trip import town
from tests.sim_worker.driving import altered

IDENTIFIED = {
    "steering_ratio": 15.4, "steering_offset_rad": 0.0038, "steering_lag_s": 0.083,
    "drive_gain": 0.96, "brake_gain": 1.05, "accel_delay_s": 0.06, "rolling_resistance_n": 150.0,
}  # fmt: skip


@pytest.mark.judge
@pytest.mark.timeout(900)
@pytest.mark.parametrize("found", [{}, IDENTIFIED], ids=["vehicle_file", "identified"])
def test_the_embedded_drive_accuses_nobody(found: dict[str, float]) -> None:
    inputs, parameters = town(), read_parameters()
    way = standin_path(inputs.osm, inputs.graph, inputs.routes[0])
    path = DrivenPath(way.lat_deg, way.lon_deg, way.speed_mps, driver=parameters.driver)
    source = StandinSource(path, parameters, vehicle_id="ego")
    frame = LocalFrame(GeoPoint(float(way.lat_deg[0]), float(way.lon_deg[0])))
    detector = FaultDetector(source.info, altered(load_vehicle(), **found), frame=frame)
    samples = source.advance(START_STAMP_NS + 200_000_000_000)
    assert [verdict for sample in samples if (verdict := detector.handle(*sample))] == []
    assert source.ended
