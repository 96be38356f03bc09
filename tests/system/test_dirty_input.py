"""A drive with bad positions and a stretch off the map is survived, counted and reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.frames import geo_from_local, local_from_geo
from foretwin.geometry.polyline import points_at
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from foretwin.telemetry.logs import read_line
from foretwin.world_gen.osm.read_osm import read_map
from tests.system.foretwin_command import foretwin

SPEED_MPS = 9.0
RATE_HZ = 5
DRIVE_S = 45
AWAY_S = (25.0, 33.0)
NOT_FINITE, ZEROS, JUMPS = (40, 41, 90), (60, 120), (75,)


def dirty_gpx(path: Path) -> Path:
    """Write the embedded route driven at 9 m/s for 45 s, with what receivers do to it."""
    frame = read_map(MAP_FILE).frame
    line = read_line(ROUTE_FILE)
    route = local_from_geo(frame, line.lat_deg, line.lon_deg)
    points = []
    for number in range(DRIVE_S * RATE_HZ):
        time_s = number / RATE_HZ
        xy = points_at(route, 20.0 + SPEED_MPS * time_s)
        if AWAY_S[0] <= time_s < AWAY_S[1]:
            xy = xy + np.array([0.0, 1500.0])
        if number in JUMPS:
            xy = xy + np.array([400.0, 0.0])
        lat, lon = geo_from_local(frame, xy)
        text = f'lat="{lat:.9f}" lon="{lon:.9f}"'
        if number in NOT_FINITE:
            text = 'lat="nan" lon="nan"'
        if number in ZEROS:
            text = 'lat="0.0" lon="0.0"'
        stamp = f"2026-01-01T00:00:{int(time_s):02d}.{round(time_s % 1 * 1000):03d}Z"
        points.append(f"<trkpt {text}><time>{stamp}</time></trkpt>")
    path.write_text(
        '<?xml version="1.0"?><gpx version="1.1" creator="test" '
        'xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>\n'
        + "\n".join(points)
        + "\n</trkseg></trk></gpx>\n"
    )
    return path


@pytest.mark.judge
def test_dirty_positions_are_counted_and_the_drive_goes_on(tmp_path: Path) -> None:
    log = dirty_gpx(tmp_path / "dirty.gpx")
    run = foretwin(
        tmp_path / "runs", "--map", str(MAP_FILE), "--log", str(log), "--speed", "max",
        "--futures", "4", "--rate", "1",
    )  # fmt: skip
    assert run.code == 0, run.screen
    record = run.record()
    refused = len(NOT_FINITE) + len(ZEROS) + len(JUMPS)
    assert record["telemetry"]["skipped_invalid"] >= refused
    assert record["route_source"] == "predicted"
    texts = [row["text"] for row in run.rows("events")]
    assert any(text.startswith("off the map") for text in texts), texts
    assert any(text.startswith("back on the map") for text in texts), texts
    at_s = [row["drive_time_s"] for row in run.rows("rounds")]
    assert not [t for t in at_s if AWAY_S[0] + 4.0 < t < AWAY_S[1]]
    assert [t for t in at_s if t > AWAY_S[1] + 4.0]
    kinds = [junction["kind"] for junction in record["intersections"]]
    assert kinds.count("roundabout") <= 1
    assert len({junction["id"] for junction in record["intersections"]}) == len(kinds)
