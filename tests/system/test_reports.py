"""Reports of a real drive, of a sweep and of two runs: every link leads somewhere, no file is too
large, and every third future that they name is played again to its hash."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.orchestrator.report.read_page import MOST_BYTES, ReadPage
from tests.system.foretwin_command import REPOSITORY, environment, foretwin

DRAWN_TOWN = REPOSITORY / "orchestrator" / "embedded" / "drawn_town.osm"
pytestmark = [pytest.mark.judge, pytest.mark.timeout(1800)]
SWEEP = """
sample = 2
scenarios = ["ccftap", "scp"]
cases = 2
planners = ["pure_pursuit_idm", "constant_speed"]
seed = 1
"""


def asked(folder: Path, *arguments: str, code: int = 0) -> str:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "foretwin", *arguments],
        cwd=folder, env=environment(folder / "cache"), text=True, timeout=600,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    assert done.returncode == code, done.stdout
    return done.stdout


def look_through(folder: Path, *of: str) -> tuple[int, int]:
    """Write a report and try all that it offers; returns its links, and the futures played."""
    asked(folder, "report", *of, "--out", "report.html")
    html = (folder / "report.html").read_text(encoding="utf-8")
    assert len(html.encode()) < MOST_BYTES
    page = ReadPage(html)
    assert page.loaded == []
    inside = [link for link in page.links if link.startswith("#")]
    assert [link for link in inside if link[1:] not in page.anchors] == []
    assert inside == page.links
    commands = [one.split() for one in page.codes if one.startswith("foretwin repeat")]
    for command in commands[::3]:
        told = json.loads(asked(folder, *command[1:], "--json"))
        assert told["equal"], told
    return len(inside), len(commands[::3])


@pytest.mark.real_data
def test_all_that_the_report_of_a_real_drive_offers_holds(tmp_path: Path, data_dir: Path) -> None:
    where = data_dir / "osm-berlin-mitte" / "berlin-mitte.osm"
    drive = data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt"
    driven = "--map", str(where), "--log", str(drive), "--route", "from-log", "--end", "70"
    run = foretwin(tmp_path / "runs", *driven, "--speed", "max", "--futures", "32").run
    assert run is not None

    links, played = look_through(tmp_path, str(run))

    print(f"\n{links} links, {played} futures played again")
    assert links >= 10
    assert played >= 4


def test_all_that_the_reports_of_a_sweep_and_of_two_runs_offer_holds(tmp_path: Path) -> None:
    spec = f'map = "{DRAWN_TOWN}"\n{SWEEP}'
    (tmp_path / "sweep.toml").write_text(spec, encoding="utf-8")
    asked(tmp_path, "sweep", "sweep.toml", "--out", "sweep")
    short = "--speed", "max", "--end", "20", "--futures", "16"
    one, two = (foretwin(tmp_path / name, *short).run for name in ("one", "two"))

    of_sweep = look_through(tmp_path, "sweep")
    of_two = look_through(tmp_path, str(one), str(two))

    print(f"\nsweep: {of_sweep}, two runs: {of_two}")
    assert min(*of_sweep, of_two[0]) >= 1
