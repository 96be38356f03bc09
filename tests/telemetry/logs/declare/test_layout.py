"""How people's programs lay out a table: remarks, units below names, blanks, encodings, clocks."""

from __future__ import annotations

import datetime
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.drive import GnssFix, SpeedSample
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.declare.layout import TextLayout, layout_of
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.write_declaration import declaration_toml
from tests.telemetry.logs.declare.test_propose import country, drawn_drive

SPRING = datetime.datetime(2024, 5, 3, 23, 58, 40, tzinfo=datetime.UTC)
"""A drive of 150 s from here goes over midnight."""

Row = tuple[str, str, str, str]
"""Time, latitude, longitude, speed in km/h."""


@pytest.mark.parametrize("other", ["\x0b", "\x0c", "\x1c", "\x85", "\u2028"])
def test_what_breaks_lines_in_unicode_alone_breaks_none_here(tmp_path: Path, other: str) -> None:
    """Readers of tables do not break there: lines that are left out would be others."""
    (path := tmp_path / "drive.csv").write_text(
        "by" + f"{other}me" * 30 + "\nt,v,w\n1,2,3\n4,5,6\n"
    )
    layout = layout_of(path, path.read_text())
    assert (layout.skip_lines, layout.rows_from) == (1, 2)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_no_table_is_refused_in_a_line(tmp_path: Path, seed: int) -> None:
    (path := tmp_path / "drive.csv").write_bytes(random.Random(seed).randbytes(4000))
    with pytest.raises(LogError):
        propose(path)


def rows_of_a_drive(clock: Callable[[float], str]) -> list[Row]:
    drive = drawn_drive()
    gnss, speed = drive["gnss"], drive["speed"]
    kmh = 3.6 * np.interp(gnss.stamps_ns, speed.stamps_ns, speed.columns["forward"])
    lat, lon = gnss.columns["latitude"], gnss.columns["longitude"]
    return [
        (clock(t), f"{a:.8f}", f"{b:.8f}", f"{v:.3f}")
        for t, a, b, v in zip(gnss.stamps_ns / 1e9, lat, lon, kmh, strict=True)
    ]


def seconds(time_s: float) -> str:
    return f"{time_s:.2f}"


def moment(written: str) -> Callable[[float], str]:
    def clock(time_s: float) -> str:
        at = SPRING + datetime.timedelta(seconds=time_s)
        return at.strftime(written).replace("%fff", f"{at.microsecond // 1000:03d}")

    return clock


def text_of(rows: list[Row], *, between: str, head: str, end: str = "\n") -> str:
    return head.replace("\n", end) + "".join(between.join(row) + end for row in rows)


def checked(path: Path, *, first_s: float | None = None) -> str:
    """Declare a table and hold what is read with it against the drive; return the declaration."""
    found = propose(path, country_of=country)
    assert found.question is None
    assert found.declaration is not None
    declared = path.with_name("declared.toml")
    declared.write_text(declaration_toml(found.declaration, said=found.evidence), encoding="utf-8")
    log = open_log(path, declaration=declared)
    said = [message for _, message in log.samples()]
    fixes = [one for one in said if isinstance(one, GnssFix)]
    speeds = [one.speed_mps for one in said if isinstance(one, SpeedSample)]
    drive = drawn_drive()["gnss"]
    start_ns = log.info.start_stamp_ns
    assert [one.stamp_ns - start_ns for one in fixes] == pytest.approx(
        drive.stamps_ns.tolist(), abs=5_000_000
    )
    assert [one.position.lat_deg for one in fixes] == pytest.approx(
        drive.columns["latitude"].tolist(), abs=1e-7
    )
    assert np.median(speeds) == pytest.approx(9.3, abs=1.0)
    if first_s is not None:
        assert start_ns == pytest.approx(first_s * 1e9, abs=2_000_000)
    return declared.read_text(encoding="utf-8")


NAMES = "t,lat,lon,v\n"


@pytest.mark.parametrize(
    ("head", "skipped"),
    [
        (NAMES, 0),
        (f"{NAMES}s,deg,deg,km/h\n", 0),
        (f"s,deg,deg,km/h\n{NAMES}", 1),
        (f"# my drive\n# of 2024, in May\n{NAMES}", 2),
        (f'"Measurement export"\n"File","drive.mf4"\n\n{NAMES}[s],[deg],[deg],[km/h]\n', 3),
        (f"sep=,\n{NAMES}", 1),
        ("", 0),
    ],
)
def test_lines_before_and_below_the_names_are_none_of_the_drive(
    tmp_path: Path, head: str, skipped: int
) -> None:
    path = tmp_path / "drive.csv"
    path.write_text(text_of(rows_of_a_drive(seconds), between=",", head=head))
    declared = checked(path)
    assert ("skip_lines" in declared) == (skipped > 0)
    assert skipped == 0 or f"skip_lines = {skipped}\n" in declared
    assert ("header = false" in declared) == (not head)


@pytest.mark.parametrize(
    ("encoding", "between", "end"),
    [
        ("utf-16", "\t", "\r\n"),
        ("utf-8-sig", ";", "\r\n"),
        ("cp1252", ";", "\n"),
        ("utf-8", ",", "\r"),
        ("utf-8", "    ", "\n"),
    ],
)
def test_encodings_line_ends_and_blanks(
    tmp_path: Path, encoding: str, between: str, end: str
) -> None:
    path = tmp_path / "drive.csv"
    head = between.join(("Zeit", "Breite", "Länge", "v")) + "\n"
    text = text_of(rows_of_a_drive(seconds), between=between, head=head, end=end)
    path.write_bytes(text.encode(encoding))
    assert 'column = "Länge"' in checked(path)


@pytest.mark.parametrize(
    ("written", "unit", "first_s"),
    [
        ("%d.%m.%Y %H:%M:%S.%fff", "dmy", SPRING.timestamp()),
        ("%Y/%m/%d %H:%M:%S.%fff", "ymd", SPRING.timestamp()),
        ("%m/%d/%Y %I:%M:%S.%fff %p", "mdy", SPRING.timestamp()),
        ("%Y-%m-%dT%H:%M:%S.%fff+02:00", "iso8601", SPRING.timestamp() - 7200.0),
        ("%H:%M:%S.%fff", "clock", 86_320.0),
        ("%H%M%S.%fff", "hhmmss", 86_320.0),
    ],
)
def test_clocks_as_people_write_them(
    tmp_path: Path, written: str, unit: str, first_s: float
) -> None:
    path = tmp_path / "drive.csv"
    # %f has six digits and no program writes them all.
    clock = moment(written.replace("%fff", "%%fff"))
    path.write_text(text_of(rows_of_a_drive(clock), between=";", head="when;lat;lon;v\n"))
    declared = checked(path, first_s=first_s)
    assert f'unit = "{unit}"' in declared
    assert ('base = "boot"' in declared) == (unit in ("clock", "hhmmss"))
    assert ("no zone told" in declared) == (unit in ("dmy", "ymd", "mdy"))
    assert ("by usage alone" in declared) == (unit in ("dmy", "mdy"))


def test_a_day_in_a_column_of_its_own_goes_with_the_time(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    clock = moment("%d.%m.%Y;%H:%M:%S.%%fff")
    path.write_text(text_of(rows_of_a_drive(clock), between=";", head="day;time;lat;lon;v\n"))
    assert 'date = "day"' in checked(path, first_s=SPRING.timestamp())


@pytest.mark.parametrize(("unit", "zero_d"), [("days1900", 25_569.0), ("datenum", 719_529.0)])
def test_days_as_spreadsheets_count_them(tmp_path: Path, unit: str, zero_d: float) -> None:
    path = tmp_path / "drive.csv"
    first_d = SPRING.timestamp() / 86_400.0 + zero_d
    rows = rows_of_a_drive(lambda time_s: f"{first_d + time_s / 86_400.0:.9f}")
    text = text_of(rows, between=";", head="day;lat;lon;v\n").replace(".", ",")
    path.write_text(text)
    assert f'unit = "{unit}"' in checked(path, first_s=SPRING.timestamp())


def test_of_two_columns_with_one_name_the_second_is_numbered(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    rows = [
        (*row[:3], f"{number % 7}", row[3]) for number, row in enumerate(rows_of_a_drive(seconds))
    ]
    path.write_text(text_of(rows, between=",", head="t,lat,lon,v,v\n"))  # type: ignore[arg-type]
    assert 'forward = { column = "v (2)", unit = "km/h" }' in checked(path)


def test_cells_with_delimiters_in_quotes_and_half_lines_do_not_mislead(tmp_path: Path) -> None:
    lines = ['"a, b",c', *['1.5,"2"'] * 40, "3"]
    assert layout_of(tmp_path, "\n".join(lines)) == TextLayout(",", ".", True, 0, 1)
    lines = ["a b", *["1,5\t2"] * 40]
    assert layout_of(tmp_path, "\n".join(lines))[:2] == ("\t", ",")


def test_racelogics_vbo_is_refused_by_its_name(tmp_path: Path) -> None:
    """Its longitudes grow to the west: read as a table the drive lay in the Atlantic."""
    head = "[header]\nlatitude\n\n[column names]\ntime lat long velocity\n\n[data]\n"
    path = tmp_path / "drive.vbo"
    path.write_text(text_of(rows_of_a_drive(seconds), between=" ", head=head))
    with pytest.raises(LogError, match=r"Racelogic's VBO, which is not read: .* to the west"):
        propose(path)
