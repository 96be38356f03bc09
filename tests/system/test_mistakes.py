"""Mistakes of a new user, over all commands: each gets one line that names it, and exit code 2."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from foretwin.sim_worker.vehicle.parameters import DEFAULT_FILE

MAP, ROUTE = shlex.quote(str(MAP_FILE)), shlex.quote(str(ROUTE_FILE))

MISTAKES = (
    # What is typed, and what the line has to name.
    ("dirve", "Did you mean 'drive'"),
    ("drive --mpa a.osm", "did you mean --map?"),
    ("drive --map", "--map"),
    ("drive --futures many", "--futures many"),
    ("drive --futures 0", "--futures 0: at least 1"),
    ("drive --futures 8.5", "--futures 8.5"),
    ("drive --rate 2Hz", "--rate 2Hz"),
    ("drive --rate 100", "--rate 100.0: above 0, at most 50"),
    ("drive --horizon 8s", "--horizon 8s"),
    ("drive --horizon 90", "--horizon 90.0: 1 to 60"),
    ("drive --speed fast", "--speed fast: a number above 0, or max"),
    ("drive --workers 100000", "--workers 100000: 1 to"),
    ("drive --seed -1", "--seed -1: 0 to"),
    ("drive --view nativ --workers 1", "nativ: did you mean native?"),
    ("drive --source lgo", "--source lgo: did you mean log?"),
    ("drive --tuning reprot", "--tuning reprot: did you mean report?"),
    ("drive --map-aiding on", "--map-aiding on: one of auto, off"),
    ("drive --planner pure_pursuit", "did you mean pure_pursuit_idm?"),
    ("drive --keep 20Gb", "20Gb"),
    ("drive --metrics 99999999", "99999999"),
    ("drive --vehicle bmw", "bmw"),
    (f"drive --map {MAP}", "--map needs --log FILE"),
    ("drive --log DRIVE.gpx", "--log needs --map FILE"),
    (f"drive --map {MAP} --log nowhere.mcap", "nowhere.mcap"),
    (f"drive --map nowhere.osm --route {ROUTE}", "nowhere.osm"),
    (f"drive --map folder --route {ROUTE}", "folder"),
    (f"drive --map empty.osm --route {ROUTE}", "empty.osm"),
    (f"drive --map binary.osm.pbf --route {ROUTE}", "binary.osm.pbf"),
    (f"drive --map {MAP} --route text.txt", "text.txt"),
    (f"drive --map {MAP} --log binary.mcap", "binary.mcap"),
    (f"drive --map {MAP} --log empty.csv", "empty.csv"),
    ("drive --start 5", "--start 5.0: needs --log"),
    ("drive --towards-vehicle", "--towards-vehicle needs --ros2"),
    ("drive --endpoint localhost", "localhost"),
    ("drive --config nowhere.toml", "nowhere.toml: no such file"),
    ("drive --config folder", "folder: is a folder, not a file"),
    ("drive --config latin1.toml", "line 1 is no UTF-8 text"),
    ("drive --config broken.toml", "broken.toml: line 2: not TOML"),
    ("drive --config wrong_key.toml", "line 2: unknown key 'futurs'; did you mean futures?"),
    ("drive --config wrong_value.toml", "line 1: view 'nativ': did you mean native?"),
    ("drive --config wrong_type.toml", "line 1: futures 'many': must be a whole number"),
    ("drive --config wrong_range.toml", "line 1: radius_m 5.0: 20 to 2000"),
    ("drive --vehicle wrong_unit.toml", "mass_kg 1.5 is implausible; it must be 150 to 60000"),
    ("drive --vehicle wrong_std.toml", "unknown key 'sdt' in mass_kg; did you mean std?"),
    ("intersections nowhere.osm", "nowhere.osm"),
    ("intersections folder", "folder"),
    ("intersections empty.osm", "empty.osm"),
    ("intersections binary.osm.pbf", "binary.osm.pbf"),
    ("intersections text.txt", "text.txt"),
    (f"intersections {MAP} --route nowhere.gpx", "nowhere.gpx"),
    (f"world {MAP}", "--out"),
    (f"world {MAP} --out w.xml", "exactly one of --at LAT,LON"),
    (f"world {MAP} --out w.stl --id n4", "w.stl: ends in none of"),
    (f"world {MAP} --at 45,-30 --out w.jpg", "w.jpg: ends in none of"),
    (f"world {MAP} --at 45 --out w.png", "--at"),
    (f"world {MAP} --at -30,45 --out w.png", "-30"),
    (f"world {MAP} --id n999 --out w.png", "n999"),
    (f"world {MAP} --id n4 --out w.png --format opendirve", "did you mean opendrive?"),
    (f"world {MAP} --id n4 --out nowhere/w.png", "nowhere"),
    (f"world {MAP} --id n4 --out w.xodr --opendrive-version 2", "one of 1.8, 1.4"),
    (f"world {MAP} --id n4 --out w.png --radius 5km", "--radius 5km"),
    (f"world {MAP} --bbox 1,2,3 --out w.png", "--bbox"),
    ("sweep nowhere.toml", "nowhere.toml: no such file"),
    ("sweep sweep_key.toml", "line 2: unknown key 'scenario'; did you mean scenarios?"),
    ("sweep sweep_metric.toml", "did you mean ttc?"),
    ("sweep sweep_number.toml", "did you mean friction_factor?"),
    ("sweep sweep_scenario.toml", "did you mean ccftap?"),
    ("sweep folder", "folder"),
    ("sweep sweep_scenario.toml --engine rey", "did you mean ray?"),
    ("convert nowhere.csv out.mcap", "nowhere.csv"),
    ("convert text.txt out.mcap", "text.txt"),
    (f"convert {ROUTE} out.mp4", "out.mp4"),
    ("declare nowhere.csv", "nowhere.csv"),
    ("declare empty.csv", "empty.csv"),
    ("declare folder", "folder"),
    ("identify nowhere.mcap", "nowhere.mcap"),
    ("gap nowhere.mcap", "nowhere.mcap"),
    ("judge nowhere", "nowhere"),
    ("judge folder", "folder"),
    ("repeat folder 1234", "folder"),
    ("recover nowhere", "nowhere"),
    ("collect nowhere", "nowhere"),
    ("view nowhere", "nowhere"),
    ("tracks add nowhere.mcap", "nowhere.mcap"),
    ("tracks delete", "id"),
    ("scenarios check nowhere.toml", "nowhere.toml"),
    ("scenarios check wrong_key.toml", "wrong_key.toml"),
    ("scenarios check empty.toml", "the key 'id' is missing"),
    (f"scenarios draw ccftab --map {MAP} --out a.png", "did you mean ccftap?"),
    ("map get 13,52,14 --out a.osm", "13,52,14"),
    ("map get 13.0,52.0,13.1,52.1 --out a.osm", "--config FILE"),
    ("map index nowhere.osm.pbf", "nowhere.osm.pbf"),
    ("set mass", "mass: must be KEY=VALUE"),
    ("secure show --folder nowhere", "nowhere"),
    ("learn-progress nowhere.mcap --out a.npz", "nowhere.mcap"),
    ("config --check broken.toml", "line 2: not TOML"),
    ("worker --connect nowhere", "nowhere"),
)  # fmt: skip

FILES = {
    "text.txt": b"once upon a time\n",
    "empty.osm": b"",
    "empty.csv": b"",
    "empty.toml": b"",
    "binary.mcap": os.urandom(4000),
    "binary.osm.pbf": bytes(range(256)) * 16,
    "latin1.toml": "out = 'Stra\u00dfe'\n".encode("latin-1"),
    "broken.toml": b"futures = 8\nout = \n",
    "wrong_key.toml": b"# mine\nfuturs = 8\n",
    "wrong_value.toml": b"view = 'nativ'\n",
    "wrong_type.toml": b"futures = 'many'\n",
    "wrong_range.toml": b"radius_m = 5\n",
    "sweep_key.toml": b"map = 'a.osm'\nscenario = ['ccftap']\n",
    "sweep_metric.toml": b"map = 'a.osm'\nmetrics = ['tcc']\n",
    "sweep_number.toml": b"map = 'a.osm'\n[parameters]\nfriction = [0.5]\n",
    "sweep_scenario.toml": b"map = 'a.osm'\nscenarios = ['ccftab']\n",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with what a new user may name by mistake."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "folder").mkdir()
    for name, data in FILES.items():
        (tmp_path / name).write_bytes(data)
    car = DEFAULT_FILE.read_text(encoding="utf-8")
    (tmp_path / "wrong_unit.toml").write_text(car.replace("1093.2952334674046", "1.5"))
    (tmp_path / "wrong_std.toml").write_text(car.replace("std = 50.0", "sdt = 50.0", 1))
    return tmp_path


def test_there_are_more_than_seventy() -> None:
    assert len({typed for typed, _ in MISTAKES}) == len(MISTAKES) > 70


@pytest.mark.judge
@pytest.mark.parametrize(("typed", "named"), MISTAKES, ids=[typed[:40] for typed, _ in MISTAKES])
def test_a_mistake_gets_one_line_that_names_it(
    typed: str, named: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code = run(shlex.split(typed))
    told = capfd.readouterr().err.strip()
    assert code == 2, told
    assert told.count("\n") == 0, told
    assert told.startswith("foretwin"), told
    assert named in told
    assert "internal error" not in told
    assert not list(folder.glob("runs/*"))
