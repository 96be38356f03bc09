"""South and west, told by a letter in a column beside the number, as NMEA does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.declare import propose
from foretwin.telemetry.logs.declare.hemispheres import negated_by_letters
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.write_declaration import declaration_toml
from tests.telemetry.logs.declare.test_propose import drawn_drive

SOUTH_WEST = ("S", "W")


def lettered(folder: Path, *, letters: tuple[str, str], before: bool = False) -> Path:
    """The drawn drive as degrees without a sign, each with its letter."""
    gnss = drawn_drive()["gnss"]
    lines = ["t,NS,Lat,EW,Lon" if before else "t,Lat,NS,Lon,EW"]
    for stamp_ns, lat, lon in zip(
        gnss.stamps_ns, gnss.columns["latitude"], gnss.columns["longitude"], strict=True
    ):
        cells = [f"{one:.7f}" for one in (lat, lon)]
        pairs = zip(letters, cells, strict=True) if before else zip(cells, letters, strict=True)
        lines.append(
            ",".join([f"{stamp_ns / 1e9:.3f}", *(cell for pair in pairs for cell in pair)])
        )
    path = folder / "lettered.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize(("letters", "signs"), [(SOUTH_WEST, (-1, -1)), (("N", "E"), (1, 1))])
def test_a_drive_lies_where_its_letters_say(
    tmp_path: Path, letters: tuple[str, str], signs: tuple[int, int], before: bool
) -> None:
    path = lettered(tmp_path, letters=letters, before=before)
    proposed = propose(path)
    assert proposed.declaration is not None
    Path(f"{path}.toml").write_text(declaration_toml(proposed.declaration))
    first = next(message for _, message in open_log(path).samples())
    assert isinstance(first, GnssFix)
    assert first.position.lat_deg == pytest.approx(48.1 * signs[0], abs=1e-3)
    assert first.position.lon_deg == pytest.approx(11.6 * signs[1], abs=1e-3)


def test_a_letter_that_changes_on_the_way_is_refused(tmp_path: Path) -> None:
    path = lettered(tmp_path, letters=("N", "E"))
    lines = path.read_text().splitlines()
    lines[5:10] = [line.removesuffix("E") + "W" for line in lines[5:10]]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(LogError, match=r"'EW' says E and W: write 'Lon' with a sign"):
        propose(path)


def test_numbers_with_a_sign_of_their_own_keep_it() -> None:
    columns = {"lat": np.array([-33.9, -33.8]), "lon": np.array([18.4, 18.5])}
    letters = {"ns": frozenset("S"), "ew": frozenset("W")}
    names = ["lat", "ns", "lon", "ew"]
    assert negated_by_letters(names, columns, letters) == {"lon": "ew"}


def test_a_gear_is_no_hemisphere() -> None:
    columns = {"lat": np.array([33.9, 33.8]), "lon": np.array([18.4, 18.5])}
    assert negated_by_letters(["lat", "gear", "lon"], columns, {"gear": frozenset("N")}) == {}


def test_columns_that_are_no_numbers_are_named(tmp_path: Path) -> None:
    path = lettered(tmp_path, letters=SOUTH_WEST)
    lines = path.read_text().splitlines()
    lines = [lines[0] + ",v", *(line + ",36.0 km/h" for line in lines[1:])]
    path.write_text("\n".join(lines) + "\n")
    assert "no numbers, not read: NS (such as S), EW (such as W), v (such as 36.0 km/h)" in (
        propose(path).unknown
    )

    glued = [lines[0].replace("NS,", "").replace(",EW", "")]
    glued += [line.replace(",S", "S").replace(",W", "W") for line in lines[1:]]
    path.write_text("\n".join(glued) + "\n")
    with pytest.raises(LogError, match=r"no numbers stand in Lat \(such as 48\.\d+S\)"):
        propose(path)
