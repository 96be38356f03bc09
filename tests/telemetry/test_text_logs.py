"""Small logs written by hand: GPX, GeoJSON, smartLoc, and what is wrong with bad ones."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from foretwin.telemetry.logs import LogError, line_of_log, open_log, read_line
from foretwin.telemetry.logs.log import UNREADABLE_ROW

COVERS = (
    "foretwin.telemetry.logs",
    "foretwin.telemetry.logs.geojson",
    "foretwin.telemetry.logs.gpx",
    "foretwin.telemetry.logs.route_line",
    "foretwin.telemetry.logs.opening",
)

GPX = """<?xml version="1.0"?>
<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">
<rte><rtept lat="52.0" lon="13.0"/><rtept lat="52.1" lon="13.1"/></rte>
{track}
</gpx>"""
TRACK = """<trk><trkseg>
<trkpt lat="52.5" lon="13.4"><ele>34.5</ele><time>2026-03-01T10:00:00Z</time></trkpt>
<trkpt lat="52.6" lon="13.5"><time>2026-03-01T11:00:00.250+01:00</time></trkpt>
<trkpt lat="0" lon="0"><time>2026-03-01T10:00:01Z</time></trkpt>
<trkpt lat="52.7" lon="13.5"><time>2026-03-01T10:00:00.100Z</time></trkpt>
<trkpt lat="52.8" lon="13.5"><time>2026-03-01T10:00:02Z</time></trkpt>
<trkpt lat="52.9" lon="13.5"/>
</trkseg></trk>"""


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_gpx_track_is_a_log_in_utc(tmp_path: Path) -> None:
    log = open_log(write(tmp_path, "ride.gpx", GPX.format(track=TRACK)))
    samples = list(log.samples())
    assert [m.stamp_ns - log.info.start_stamp_ns for _, m in samples] == [  # type: ignore[attr-defined]
        0,
        100_000_000,
        250_000_000,
        2_000_000_000,
    ]
    assert log.info.start_stamp_ns == 1_772_359_200_000_000_000
    assert log.info.time_base == "utc"
    assert log.skipped == {"position (0, 0)": 1, "unreadable row": 1}
    list(log.samples())
    assert log.skipped.total() == 2, "counted anew at each reading"


@pytest.mark.parametrize(
    ("said", "std_m"),
    [
        ("", None),
        ("<fix>3d</fix><hdop>1.5</hdop>", 3.15),
        ("<fix>dgps</fix>", 1.7),
        ("<hdop>2.0</hdop>", 4.2),
        ("<fix>5d</fix><hdop>0</hdop>", None),
    ],
)
def test_how_good_gpx_points_are_is_what_fix_and_hdop_promise(
    tmp_path: Path, said: str, std_m: float | None
) -> None:
    log = open_log(
        write(tmp_path, "ride.gpx", GPX.format(track=TRACK.replace("</ele>", "</ele>" + said)))
    )
    first, second, *_ = (fix.std_m for _, fix in log.samples())  # type: ignore[attr-defined]
    assert first == (None if std_m is None else pytest.approx(std_m))
    assert second is None


def test_gpx_points_without_a_fix_are_counted(tmp_path: Path) -> None:
    track = TRACK.replace("</ele>", "</ele><fix>none</fix>")
    log = open_log(write(tmp_path, "ride.gpx", GPX.format(track=track)))
    assert len(list(log.samples())) == 3
    assert log.skipped["receiver without fix"] == 1


def test_gpx_route_is_a_line_and_no_log(tmp_path: Path) -> None:
    path = write(tmp_path, "plan.gpx", GPX.format(track=""))
    np.testing.assert_array_equal(read_line(path).lat_deg, [52.0, 52.1])
    with pytest.raises(LogError, match=r"plan\.gpx: track without time"):
        open_log(path)


def test_gpx_prefers_the_track_as_line(tmp_path: Path) -> None:
    path = write(tmp_path, "both.gpx", GPX.format(track=TRACK))
    assert read_line(path).lat_deg.tolist() == [52.5, 52.6, 52.7, 52.8, 52.9]


def feature(**properties: object) -> str:
    line = {"type": "LineString", "coordinates": [[13.4, 52.5, 30.0], [13.5, 52.6]]}
    return json.dumps({"type": "Feature", "geometry": line, "properties": properties})


@pytest.mark.parametrize(
    "times",
    [
        ["2026-03-01T10:00:00Z", "2026-03-01T10:00:01Z"],
        [1_772_359_200, 1_772_359_201],
        [1_772_359_200_000, 1_772_359_201_000],
    ],
)
@pytest.mark.parametrize("name", ["coordTimes", "times"])
def test_geojson_line_with_times_is_a_log(tmp_path: Path, name: str, times: list[object]) -> None:
    log = open_log(write(tmp_path, "drive.geojson", feature(**{name: times})))
    fixes = [message for _, message in log.samples()]
    assert [fix.stamp_ns for fix in fixes] == [  # type: ignore[attr-defined]
        1_772_359_200_000_000_000,
        1_772_359_201_000_000_000,
    ]
    assert line_of_log(log).lon_deg.tolist() == [13.4, 13.5]


def test_geojson_may_begin_with_a_mark_of_its_bytes(tmp_path: Path) -> None:
    log = open_log(write(tmp_path, "drive.geojson", "\ufeff" + feature(times=[1, 2])))
    assert len(list(log.samples())) == 2


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"type": "FeatureCollection", "features": []}', "holds no LineString but nothing"),
        ('{"type": "Point", "coordinates": [1, 2]}', "holds no LineString but Point"),
        ('{"bbox": [1, 2]}', "no GeoJSON: an object whose `type` is such as FeatureCollection"),
        ("[1, 2]", "no GeoJSON: an object"),
        ('{"type": 5}', "no GeoJSON: an object"),
        ('{"type": "LineString", "coordinates": []}', "an empty LineString"),
        ('{"type": "LineString", "coordinates": [[13.4, 52.5]]}', "a line needs two"),
        ("{", "no valid JSON"),
        ('{"type": "FeatureCollection", "features": 5}', "holds no LineString but nothing"),
        ('{"type": "GeometryCollection", "geometries": 1}', "holds no LineString but nothing"),
        ('{"type": "LineString", "coordinates": 5}', "an empty LineString"),
        ('{"type": "MultiLineString", "coordinates": [5]}', "an empty MultiLineString"),
        ('{"type": "LineString", "coordinates": [[1e400, 1]]}', "a line needs two"),
        (f'{{"type": "LineString", "coordinates": [[1{400 * "0"}, 1]]}}', "a line needs two"),
    ],
)
def test_geojson_without_a_line(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(LogError, match=told) as caught:
        read_line(write(tmp_path, "bad.geojson", text))
    assert "bad.geojson" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_geojson_of_odd_properties_and_times(tmp_path: Path) -> None:
    odd = feature(times=[1e308, 1_772_359_201]).replace("1e+308", "1" + 400 * "0")
    for text in (odd, odd.replace("1" + 400 * "0", "1e308"), odd.replace("1" + 400 * "0", "NaN")):
        log = open_log(write(tmp_path, "drive.geojson", text))
        assert len(list(log.samples())) == 1
        assert log.skipped == {UNREADABLE_ROW: 1}
    listed = json.loads(feature()) | {"properties": [1]}
    with pytest.raises(LogError, match="line without time"):
        open_log(write(tmp_path, "drive.geojson", json.dumps(listed)))


def test_geojson_times_must_fit_the_line(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="3 times for a line of 2 positions"):
        open_log(write(tmp_path, "drive.geojson", feature(times=[1, 2, 3])))


def test_files_that_are_no_log(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"missing\.gpx: no such file"):
        open_log(tmp_path / "missing.gpx")
    with pytest.raises(LogError, match="is a folder, not a file"):
        read_line(tmp_path)
    with pytest.raises(LogError, match="no comma2k19 segment"):
        open_log(tmp_path)
    run = tmp_path / "run"
    run.mkdir()
    (run / "drive-002.mcap").touch()  # as --keep leaves it
    with pytest.raises(LogError, match=r"the folder of a run; .* drive is .*run/drive-002\.mcap$"):
        open_log(run)
    with pytest.raises(LogError, match="is empty"):
        open_log(write(tmp_path, "empty.gpx", ""))
    with pytest.raises(LogError, match="no valid XML"):
        open_log(write(tmp_path, "torn.gpx", GPX.format(track=TRACK)[:200]))
    with pytest.raises(LogError, match=r"no known log; known are MCAP.*CSV.*GPX"):
        open_log(write(tmp_path, "notes.txt", "hello"))
    with pytest.raises(LogError, match="no MCAP file"):
        open_log(write(tmp_path, "fake.mcap", "hello"))
    with pytest.raises(LogError, match=r"a route is a \.gpx"):
        read_line(write(tmp_path, "route.txt", "hello"))
