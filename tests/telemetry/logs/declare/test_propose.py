"""Drives disguised as tables that nobody declared: columns are found, asked for, or left open."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.columns import Stream, table_log
from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.declare.likeness import likeness
from foretwin.telemetry.logs.declare.motion import GRID_S
from foretwin.telemetry.logs.log import Log, LogError
from foretwin.telemetry.logs.write_declaration import declaration_toml
from foretwin.world_gen.countries.outlines import place_at
from tests.telemetry.logs.declare.disguised import Drive, Table, disguise, drive_of, with_sensors
from tests.telemetry.logs.declare.judged import Judged, judged

COVERS = (
    "foretwin.telemetry.logs.declare",
    "foretwin.telemetry.logs.declare.choice",
    "foretwin.telemetry.logs.declare.likeness",
    "foretwin.telemetry.logs.declare.motion",
    "foretwin.telemetry.logs.declare.proposal",
    "foretwin.telemetry.logs.declare.roles",
    "foretwin.telemetry.logs.declare.sections",
)
DECLARATIONS = Path(__file__).parents[3] / "data" / "declarations"


def country(lat_deg: float, lon_deg: float) -> str:
    return place_at(lat_deg, lon_deg).code


def drawn_drive(*, lat: float = 48.1, lon: float = 11.6, end_s: float = 150.0) -> Drive:
    """Some time around blocks, with stops: positions at 10 Hz and a car's sensors."""
    time_s = np.arange(0.0, end_s, 0.1)
    speed = np.clip(9.0 + 6.0 * np.sin(time_s / 9.0) + 3.0 * np.sin(time_s / 3.7), 0.0, None)
    turn = np.where(speed > 1.0, 0.25 * np.sin(time_s / 6.0) + 0.12 * np.sin(time_s / 2.3), 0.0)
    yaw = np.cumsum(turn) * 0.1
    x, y = np.cumsum(speed * np.cos(yaw)) * 0.1, np.cumsum(speed * np.sin(yaw)) * 0.1
    stamps = np.round(time_s * 1e9).astype(np.int64)
    metre_deg = 1.0 / 111_195.0
    places = {
        "latitude": lat + y * metre_deg,
        "longitude": lon + x * metre_deg / np.cos(np.radians(lat)),
    }
    drive = with_sensors({"gnss": Stream(stamps, places)}, seed=5)
    return drive | {"heading": Stream(stamps, {"yaw": np.angle(np.exp(1j * yaw))})}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Table, Judged]]:
    """The drawn drive in several disguises, and what was found of each."""
    folder = tmp_path_factory.mktemp("drawn")
    tables = [disguise(drawn_drive(end_s=100.0), folder, seed=seed) for seed in range(5)]
    return [(table, judged(table, country_of=country)) for table in tables]


@pytest.mark.parametrize("seed", range(5))
def test_nothing_of_a_drawn_drive_is_wrong_in_silence(
    drawn: list[tuple[Table, Judged]], seed: int
) -> None:
    table, found = drawn[seed]
    assert not found.refused, table.made
    assert found.why == [], table.made
    assert found.verdicts["gnss.place"] == "right"
    assert found.asked <= 1


def test_of_a_drive_that_turns_and_brakes_all_is_found(drawn: list[tuple[Table, Judged]]) -> None:
    said = [verdict for _, found in drawn for verdict in found.verdicts.values()]
    assert said.count("right") >= 0.8 * len(said)


@pytest.mark.parametrize("late_s", [-0.3, 0.35])
def test_a_late_sensor_is_put_right(tmp_path: Path, late_s: float) -> None:
    drive = drawn_drive()
    speed = drive["speed"]
    drive["speed"] = speed._replace(stamps_ns=speed.stamps_ns + round(late_s * 1e9))
    table = disguise(drive, tmp_path, seed=2, late=False)
    assert judged(table, country_of=country).late_s["speed"] == pytest.approx(late_s, abs=0.05)


def one_table(folder: Path, **columns: np.ndarray) -> Path:
    """Write the drawn drive's positions with more columns, each on their stamps."""
    gnss = drawn_drive()["gnss"]
    columns = {"t": gnss.stamps_ns / 1e9, "lat": gnss.columns["latitude"],
               "lon": gnss.columns["longitude"]} | columns  # fmt: skip
    path = folder / "one.csv"
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    path.write_text(
        ",".join(columns) + "\n" + "".join(f"{','.join(map(repr, row))}\n" for row in rows)
    )
    return path


def test_a_sensor_mounted_turned_is_turned_back(tmp_path: Path) -> None:
    yaw = drawn_drive()["heading"].columns["yaw"]
    path = one_table(
        tmp_path, h=np.degrees(np.mod(0.5 * np.pi - yaw - np.radians(40.0), 2 * np.pi))
    )
    found = propose(path).declaration
    assert found is not None
    assert found.heading is not None
    assert (found.heading.zero, found.heading.direction) == ("north", "clockwise")
    assert found.heading.offset_deg == pytest.approx(40.0, abs=0.5)


def test_a_gyro_that_is_upside_down_turns_nothing_else_round(tmp_path: Path) -> None:
    drive = drawn_drive()
    stamps = drive["gnss"].stamps_ns
    imu, steering = drive["imu"], drive["steering"]
    columns = {name: np.interp(stamps, imu.stamps_ns, imu.columns[name])
               for name in ("accel_x", "accel_y", "rate_z")}  # fmt: skip
    columns["rate_z"] = -columns["rate_z"]
    wheel = np.interp(stamps, steering.stamps_ns, steering.columns["wheel"])
    found = propose(one_table(tmp_path, **columns, wheel=wheel)).declaration
    assert found is not None
    assert found.imu is not None
    assert found.steering is not None
    assert found.imu.rate_z.negate
    assert not found.imu.accel_x.negate
    assert found.imu.accel_y is not None
    assert not found.imu.accel_y.negate
    assert found.steering.wheel is not None
    assert not found.steering.wheel.negate


def test_likeness_is_looked_for_where_a_column_is_late() -> None:
    time_s = np.arange(0.0, 120.0, GRID_S)
    signal = np.sin(time_s**1.2)
    found = likeness(np.roll(signal, round(0.4 / GRID_S)) * 3.0, signal[:, None])
    assert found is not None
    assert found.late_s == pytest.approx(0.4)
    assert found.sizes[0] == pytest.approx(3.0, rel=0.02)


def test_names_that_lie_are_given_up_where_the_motion_says_otherwise(tmp_path: Path) -> None:
    drive = drawn_drive()
    gnss, speed = drive["gnss"], drive["speed"]
    path = tmp_path / "lies.csv"
    kmh = np.interp(gnss.stamps_ns, speed.stamps_ns, speed.columns["forward"]) * 3.6
    rows = zip(gnss.stamps_ns / 1e9, gnss.columns["longitude"], gnss.columns["latitude"], kmh,
               strict=True)  # fmt: skip
    text = "".join(f"{t:.3f},{a:.8f},{b:.8f},{v:.3f}\n" for t, a, b, v in rows)
    path.write_text("t,lat,lon,speed_mph\n" + text)
    found = propose(path).declaration
    assert found is not None
    assert found.position.latitude is not None
    assert found.position.latitude.column == "lon"
    assert found.speed is not None
    assert found.speed.forward is not None
    assert found.speed.forward.unit == "km/h"


def test_what_nothing_tells_is_asked_once_and_can_be_answered(tmp_path: Path) -> None:
    # Both orders lie on land, without names and without another sensor.
    gnss = drawn_drive(lat=48.1, lon=41.6)["gnss"]
    path = tmp_path / "two.csv"
    rows = zip(gnss.stamps_ns, gnss.columns["latitude"], gnss.columns["longitude"], strict=True)
    path.write_text("".join(f"{t / 1e9:.3f},{a:.8f},{b:.8f}\n" for t, a, b in rows))
    asked = propose(path, country_of=country)
    assert asked.declaration is None
    assert asked.question is not None
    assert (asked.question.key, set(asked.question.choices)) == ("latitude", {"c2", "c3"})
    told = propose(path, country_of=country, answers={"latitude": "c2"})
    assert told.question is None
    assert told.declaration is not None
    assert told.declaration.position.longitude is not None
    assert told.declaration.position.longitude.column == "c3"
    assert any("reference_point" in line for line in told.unknown)


def test_the_sea_tells_which_is_latitude(tmp_path: Path) -> None:
    gnss = drawn_drive(lat=48.1, lon=-3.0)["gnss"]
    path = tmp_path / "two.csv"
    rows = zip(gnss.stamps_ns, gnss.columns["longitude"], gnss.columns["latitude"], strict=True)
    path.write_text("".join(f"{t / 1e9:.3f},{a:.8f},{b:.8f}\n" for t, a, b in rows))
    told = propose(path, country_of=country)
    assert told.declaration is not None
    assert told.declaration.position.latitude is not None
    assert told.declaration.position.latitude.column == "c3"
    assert any("sea" in line for line in told.evidence["position"])


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([f"{n},{n * 7 % 5},{n * 3 % 4}" for n in range(200)], "no columns that move as a car"),
        ([f"{7 - n % 3},{n % 5},{n % 2}" for n in range(200)], "no column that rises as a time"),
        (["1,2,3"] * 5, "a drive has 20 rows and more"),
        (["words only"] * 40, "0 columns of numbers"),
    ],
)  # fmt: skip
def test_what_is_no_drive_is_refused_in_one_line(
    tmp_path: Path, rows: list[str], told: str
) -> None:
    path = tmp_path / "none.csv"
    path.write_text("a,b,c\n" + "\n".join(rows) + "\n")
    with pytest.raises(LogError, match=told) as caught:
        propose(path)
    assert "\n" not in str(caught.value)


def test_an_answer_to_no_question_names_the_questions(tmp_path: Path) -> None:
    with pytest.raises(
        LogError, match="no such question; one of time, time_unit, latitude, position_unit, x, epsg"
    ):
        propose(tmp_path / "none.csv", answers={"colour": "red"})


def as_log(drive: Drive) -> Log:
    first = min(int(stream.stamps_ns[0]) for stream in drive.values())
    every = np.unique(np.concatenate([stream.stamps_ns for stream in drive.values()]))
    assert every[0] == first
    return table_log("truth", drive, stamps_ns=every, time_base="log", reference_point="unknown")  # type: ignore[arg-type]


def track_of(log: Log, frame: LocalFrame) -> tuple[np.ndarray, np.ndarray]:
    estimator = StateEstimator(log.info)
    stamps, places = [], []
    for channel, message in log.samples():
        state = estimator.handle(channel, message)
        if state is not None and channel == "gnss":
            stamps.append(message.stamp_ns)  # type: ignore[attr-defined]
            places.append((state.position.lat_deg, state.position.lon_deg))
    lat, lon = np.array(places).T
    return np.array(stamps), local_from_geo(frame, lat, lon)


def track_apart_m(drive: Drive, folder: Path) -> np.ndarray:
    """Return how far the track of a declared table lies from that of the drive, at each fix."""
    table = disguise(drive, folder, seed=1, late=False)
    found = propose(table.path, country_of=country)
    if found.question is not None:
        answers = {found.question.key: table.answers[found.question.key]}
        found = propose(table.path, country_of=country, answers=answers)
    assert found.declaration is not None
    declared = found.declaration
    text = declaration_toml(declared)
    # Lateness of the original itself is put right in one of the two alone: it is not compared.
    text = "".join(line for line in text.splitlines(keepends=True) if "late_s" not in line)
    file = table.path.with_name(table.path.name + ".toml")
    file.write_text(text)
    kept = {name: stream for name, stream in table.truth.items()
            if name == "gnss" or getattr(declared, name) is not None}  # fmt: skip
    first = GeoPoint(*(float(kept["gnss"].columns[name][0]) for name in ("latitude", "longitude")))
    frame = LocalFrame(first)
    true_ns, true_xy = track_of(as_log(kept), frame)
    said_ns, said_xy = track_of(open_log(table.path, declaration=file), frame)
    at = np.searchsorted(true_ns, said_ns + 2_000, side="right") - 1
    same = (at >= 0) & (np.abs(true_ns[at] - said_ns) < 2_000)
    assert same.sum() > 0.6 * len(true_ns)
    return np.asarray(np.hypot(*(said_xy[same] - true_xy[at[same]]).T))


@pytest.mark.real_data
@pytest.mark.parametrize("first_s", [120.0, pytest.param(math.inf, marks=pytest.mark.judge)])
@pytest.mark.parametrize("name", ["comma", "dresden", "boreas", "berlin"])
def test_a_declared_table_of_a_real_drive_is_read_right_and_driven_alike(
    data_dir: Path, tmp_path: Path, name: str, first_s: float
) -> None:
    drive = beginning(REAL[name](data_dir), first_s)
    found = judged(disguise(drive, tmp_path, seed=1), country_of=country)
    assert found.why == []
    assert found.asked <= 1
    apart_m = track_apart_m(drive, tmp_path)
    assert np.percentile(apart_m, 50) < 0.001
    # Dresden's headings and wheels contradict each other: what a table rounds off grows there.
    assert np.percentile(apart_m, 95) < (0.1 if name == "dresden" else 0.02)


def beginning(drive: Drive, seconds: float) -> Drive:
    """Return the samples of the first `seconds`."""
    end_ns = min(one.stamps_ns[0] for one in drive.values()) + 1e9 * seconds
    return {name: one.of(np.flatnonzero(one.stamps_ns < end_ns)) for name, one in drive.items()}


def _berlin(data: Path) -> Drive:
    log = open_log(data / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    return with_sensors(drive_of(log), seed=1)


def _declared(data: Path, pattern: str, name: str) -> Drive:
    return drive_of(open_log(next(data.glob(pattern)), declaration=DECLARATIONS / name))


REAL: dict[str, Callable[[Path], Drive]] = {
    "comma": lambda data: drive_of(open_log(data / "drive-comma2k19-sf" / "segment40")),
    "dresden": lambda data: _declared(data, "drive-dresden-imu/2014-03*.csv", "dresden.csv.toml"),
    "boreas": lambda data: _declared(data, "drive-boreas-toronto/*.csv", "boreas.csv.toml"),
    "berlin": _berlin,
}
