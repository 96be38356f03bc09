"""`foretwin tracks` and `--tracks`: from a recorded drive to Worlds corrected by it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.frames import local_from_geo
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.worlds.track_store import TrackStore
from tests.world_gen.driven.drives import FRAME, crossing, track

COVERS = ("foretwin.orchestrator.commands.cli_tracks",)
LINE_M = np.array([[-290.0, -0.8], [290.0, -0.8]])


def gpx(path: Path) -> Path:
    """A phone's drive along the street, a fix each second at 10 m/s."""
    one = track(LINE_M)
    rows = zip(one.lat_deg[::10], one.lon_deg[::10], strict=True)
    points = "".join(
        f'<trkpt lat="{lat:.8f}" lon="{lon:.8f}"><time>2026-01-01T00:00:{i:02d}Z</time></trkpt>'
        for i, (lat, lon) in enumerate(rows)
    )
    path.write_text(
        '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">'
        f"<trk><trkseg>{points}</trkseg></trk></gpx>",
        encoding="utf-8",
    )
    return path


def test_a_drive_is_added_listed_and_deleted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ["--store", str(tmp_path / "store")]
    assert run(["tracks", "add", str(gpx(tmp_path / "drive.gpx")), *store]) == 0
    (name,) = TrackStore(tmp_path / "store").ids()
    kept = TrackStore(tmp_path / "store").load(name)
    xy_m = local_from_geo(FRAME, kept.lat_deg, kept.lon_deg)
    assert np.abs(xy_m[10:, 1] + 0.8).max() < 0.5
    assert np.median(kept.speed_mps) == pytest.approx(10.0, abs=0.5)

    assert run(["tracks", "list", *store]) == 0
    assert f"{name}" in (said := capsys.readouterr().out)
    assert "drive.gpx" in said
    assert run(["tracks", "delete", name, *store]) == 0
    assert TrackStore(tmp_path / "store").ids() == []


@pytest.mark.parametrize(
    "arguments", [["delete"], ["delete", "--all", "0123456789ab"], ["delete", "0123456789ab"]]
)
def test_what_names_no_track_is_refused(arguments: list[str], tmp_path: Path) -> None:
    assert run(["tracks", *arguments, "--store", str(tmp_path)]) == 2


def test_a_drive_too_rough_to_tell_lanes_is_refused(tmp_path: Path) -> None:
    drive = str(gpx(tmp_path / "drive.gpx"))
    store = TrackStore(tmp_path / "store")

    assert run(["tracks", "add", drive, "--store", str(store.folder), "--std", "8"]) == 2
    assert run(["tracks", "add", drive, "--store", str(store.folder), "--std", "1.5"]) == 0
    assert [one.position_std_m for one in store.all()] == [1.5]


def test_worlds_lie_where_their_roads_were_driven_by_choice_alone(tmp_path: Path) -> None:
    crossing().read(tmp_path)
    TrackStore(tmp_path / "store").add(track(LINE_M))
    command = ["world", str(tmp_path / "sketch.osm"), "--bbox", "8.096,53.497,8.104,53.503"]

    for name, more in (("plain", []), ("driven", ["--tracks", str(tmp_path / "store")])):
        assert run([*command, "--out", str(tmp_path / f"{name}.geojson"), *more]) == 0

    plain, driven = (lane_lines(tmp_path / f"{name}.geojson") for name in ("plain", "driven"))
    moved_m = np.abs(driven[0].mean(axis=0) - plain[0].mean(axis=0))
    assert moved_m[1] * 111_195.0 == pytest.approx(0.7, abs=0.1)
    assert run([*command, "--out", str(tmp_path / "x.svg"), "--tracks", "/nowhere"]) == 2


def lane_lines(path: Path) -> list[np.ndarray]:
    features = json.loads(path.read_text(encoding="utf-8"))["features"]
    lanes = [f for f in features if f["properties"]["kind"] == "lane"]
    return [np.array(f["geometry"]["coordinates"])[:, :2] for f in lanes]
